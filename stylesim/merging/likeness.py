"""Scenes that show the same driving, whoever wrote them down: near-duplicates and overlapping cuts.

A data set is often there twice: NGSIM as a table and as CommonRoad files, a scenario in two releases, a recording
cut at other places. Ids and frames differ then, speeds do not. So each stretch of eight seconds of a vehicle that
does not drive evenly is known by the distances that it drove in each second, rounded to 0.2 m: they are the same in
any frame, at any origin and any rate that is a multiple. Of all such words about one in eight is kept (the same ones
in every scene), and scenes are alike by the words that they share. [ours]
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import UInt64

from stylesim.scene import Scene

SECONDS = 8  # of one word; with 5 s and 0.1 m smooth traffic had the same words by chance (tried)
GRAIN_M = 0.2  # chosen: float32 and rounded files move a distance by about 0.01 m
LEAST_CHANGE_M = 2.0  # summed over the word; chosen: who drives evenly is like everybody who does
KEPT_OF = 8  # one word in eight
LEAST_WORDS = 10  # fewer say nothing about a scene; chosen: ten are a minute of one vehicle
# Rounding loses about a tenth of the words of a true copy, and other tracks may have been cut; chosen.
DUPLICATE_SHARE = 0.6
OVERLAP_SHARE = 0.05  # chosen: scenes that share less than a twentieth are not reported as alike
MOST_HOLDERS = 50  # a word that so many scenes have is a habit of a simulator, not an event; chosen

Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True)
class Alike(Generic[Key]):
    """Two scenes in the order in which they came, and what share of the second one's words the first one has."""

    first: Key
    second: Key
    share: float

    @property
    def duplicate(self) -> bool:
        """True where the second has (nearly) nothing of its own."""
        return self.share >= DUPLICATE_SHARE


@dataclass
class Likeness(Generic[Key]):
    """Takes scenes one by one, keeps a few numbers of each, and tells which are alike."""

    _holders: defaultdict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    _keys: list[Key] = field(default_factory=list)
    _sizes: list[int] = field(default_factory=list)

    def add(self, key: Key, scene: Scene) -> list[Alike[Key]]:
        """Remember a scene; the earlier ones that it is like, the most alike first."""
        found = words(scene)
        number = len(self._keys)
        self._keys.append(key)
        self._sizes.append(len(found))
        shared: Counter[int] = Counter()
        for word in found.tolist():
            holders = self._holders[word]
            if len(holders) < MOST_HOLDERS:
                shared.update(holders)
                holders.append(number)
        if len(found) < LEAST_WORDS:
            return []
        alike = [Alike(self._keys[i], key, n / len(found)) for i, n in shared.items() if n >= LEAST_WORDS]
        return sorted((a for a in alike if a.share >= OVERLAP_SHARE), key=lambda a: -a.share)


def words(scene: Scene) -> UInt64[np.ndarray, " word"]:
    """The sampled words of a scene, sorted, each once; empty where nobody drives unevenly for eight seconds."""
    tracks = scene.tracks
    second = round(1.0 / tracks.dt_s)
    reach = SECONDS * second
    if tracks.n_frames <= reach or not second:
        return np.zeros(0, np.uint64)
    place = tracks.position_m[tracks.is_motor].astype(np.float64)
    driven = np.linalg.norm(place[:, second:] - place[:, :-second], axis=2)  # NaN where either end is unknown
    frames = driven.shape[1] - reach + second
    steps = np.stack([driven[:, k * second : k * second + frames] for k in range(SECONDS)], axis=-1)
    change = np.abs(np.diff(steps, axis=-1)).sum(axis=-1)
    kept = steps[change >= LEAST_CHANGE_M]  # NaN compares False
    grains = np.rint(kept / GRAIN_M).astype(np.uint64)
    code = np.zeros(len(grains), np.uint64)
    for column in grains.T:  # mixed as in splitmix64, whose multiplication wraps around on purpose
        code = (code ^ column) * np.uint64(0x9E3779B97F4A7C15)
        code ^= code >> np.uint64(29)
    return np.unique(code[code % np.uint64(KEPT_OF) == 0])
