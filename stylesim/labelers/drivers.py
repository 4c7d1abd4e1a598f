"""`DriverTable`: one mean per driver over all of its windows in all of its scenes, for at most so many drivers."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.labelers.features import FEATURES
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows, track_rows
from stylesim.labels import LabelFlag
from stylesim.scene import Scene


@dataclass(frozen=True, eq=False)
class DriverSample:
    """Mean features of every driver of a sample; NaN where none of its windows knew."""

    name: tuple[tuple[str, str], ...]  # unit, agent
    value: Float64[np.ndarray, "driver feature"]
    highway: Bool[np.ndarray, " driver"]

    def __len__(self) -> int:
        """Number of drivers."""
        return len(self.highway)


@dataclass(eq=False)
class DriverTable:
    """Collects rows scene by scene. Memory is bounded by `max_drivers`, whatever the length of the corpus.

    A driver is (unit, agent id), since a reader cuts one recording into scenes. Which drivers stay when there are
    more is a matter of a hash of `seed` and their name: any order of the scenes gives the same sample.
    """

    max_drivers: int
    seed: int
    _rows: dict[tuple[str, str], tuple[int, Float64[np.ndarray, "2 _"]]] = field(default_factory=dict)
    _limit: int = 2**64

    def add(self, scene: Scene, rows: DriverRows) -> None:
        """Count the rows of a scene: full windows only; a gap without leaders or neighbours is not an observation.

        Implausible rows (`LabelFlag.IMPLAUSIBLE`) do not count: three of 126 drivers at one recorded site, with a
        jumping position, made up a cluster of their own [ours].
        """
        value = rows.value.copy()
        value[rows.flagged(LabelFlag.NO_LEADER), FEATURES.index("s_front")] = np.nan
        value[rows.flagged(LabelFlag.NO_NEIGHBOURS), FEATURES.index("v_nei")] = np.nan
        highway = rows.flagged(LabelFlag.HIGHWAY)
        value = np.column_stack([value, highway])
        value[rows.flagged(LabelFlag.SHORT | LabelFlag.IMPLAUSIBLE)] = np.nan
        known = np.isfinite(value)
        sums = np.stack([np.where(known, value, 0.0), known.astype(np.float64)], axis=1)
        for i in np.flatnonzero(known.any(axis=1)):
            self._count((scene.unit_id, rows.agent_id[i]), sums[i])
        if len(self._rows) > 2 * self.max_drivers:
            self._prune()

    def _count(self, driver: tuple[str, str], sums: Float64[np.ndarray, "2 _"]) -> None:
        held = self._rows.get(driver)
        if held is not None:
            self._rows[driver] = (held[0], held[1] + sums)
            return
        text = f"{self.seed}\n{driver[0]}\n{driver[1]}".encode()
        place = int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "big")
        if place < self._limit:
            self._rows[driver] = (place, sums)

    def _prune(self) -> None:
        if len(self._rows) > self.max_drivers:
            ordered = sorted(self._rows.items(), key=lambda item: (item[1][0], item[0]))
            self._limit = ordered[self.max_drivers][1][0]
            self._rows = dict(ordered[: self.max_drivers])

    def sample(self) -> DriverSample:
        """The drivers' means, ordered by name."""
        self._prune()
        names = sorted(self._rows)
        if not names:
            return DriverSample((), np.zeros((0, len(FEATURES))), np.zeros(0, bool))
        sums = np.stack([self._rows[name][1] for name in names])
        mean = np.where(sums[:, 1] > 0, sums[:, 0] / np.maximum(sums[:, 1], 1), np.nan)
        return DriverSample(name=tuple(names), value=mean[:, :-1], highway=mean[:, -1] >= 0.5)  # most of its windows


def driver_samples(
    scenes: Iterable[Scene], lengths_s: Sequence[float], options: FeatureOptions, *, max_drivers: int, seed: int
) -> list[DriverSample]:
    """For each window length one sample of drivers, in one pass over the scenes."""
    tables = [DriverTable(max_drivers=max_drivers, seed=seed) for _ in lengths_s]
    for scene in scenes:
        for length, table in zip(lengths_s, tables, strict=True):
            steps = max(1, round(length / scene.tracks.dt_s))
            table.add(scene, track_rows(scene, options, length_steps=steps))
    return [_driving(t.sample(), options.parked_within_m / s) for t, s in zip(tables, lengths_s, strict=True)]


def _driving(sample: DriverSample, slowest_mps: float) -> DriverSample:
    """Without the parked: who moves less than the options allow a parked vehicle is no driver to learn from [ours]."""
    keep = ~(sample.value[:, FEATURES.index("v_avg")] <= slowest_mps)
    names = tuple(name for name, kept in zip(sample.name, keep, strict=True) if kept)
    return DriverSample(name=names, value=sample.value[keep], highway=sample.highway[keep])
