"""`Profile`: histograms of one corpus's traffic per block of it, style and cell; all that realism is computed from."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.corpus import Corpus
from stylesim.corpus.corpus import SceneInfo
from stylesim.errors import InputError
from stylesim.evaluation.collisions import collisions_of
from stylesim.evaluation.following import following
from stylesim.evaluation.realism_quantities import (
    BINS,
    CELLS,
    QUANTITIES,
    Quantity,
    cells_of,
    moving_vehicles,
    quantities_of,
)
from stylesim.labelers.tdbm import TDBM
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES

STYLES = (*STYLE_CLASSES, "undetermined")
MOST_BLOCKS = 48  # chosen: bounds memory (about 1 MB a block); more units share a block by a hash of their name
TIME_BLOCKS = 6  # chosen: of a recording that is one unit; minutes of an hour, as a block bootstrap wants them
FEW_UNITS = 4  # with fewer units, time blocks within them are compared


@dataclass(frozen=True, eq=False)
class Profile:
    """Seconds of traffic per block [block style cell quantity bin], and sums for what a histogram is too coarse for.

    Blocks are units (episodes, recordings), or stretches of time where there are fewer than FEW_UNITS units
    (`within_unit`). `square` holds seconds and the sum of squared accelerations (s, m²/s³) per block, style and cell.
    """

    name: str
    blocks: tuple[str, ...]
    within_unit: bool
    histogram: Float64[np.ndarray, "block style cell quantity bin"]
    square: Float64[np.ndarray, "block style cell 2"]
    drivers: Int64[np.ndarray, "block style"]
    km: Float64[np.ndarray, " block"]
    collisions: Int64[np.ndarray, " block"]

    def pooled(self, weight: Float64[np.ndarray, " block"] | None = None) -> Float64[np.ndarray, "style cell q bin"]:
        """The blocks' histograms added, each as often as `weight` says."""
        weight = np.ones(len(self.blocks)) if weight is None else weight
        return np.tensordot(weight, self.histogram, axes=1)


def profile_of(
    corpus: Corpus, judge: TDBM, *, name: str = "", progress: Callable[[int, int], None] | None = None
) -> Profile:
    """One pass over a corpus, one scene in memory at a time; styles are measured by `judge` on whole tracks.

    InputError if no motor vehicle moves in it.
    """
    block_of, within = _blocks(corpus.info)
    names = tuple(dict.fromkeys(block_of[info.scene_id] for info in corpus.info))
    place = {block: i for i, block in enumerate(names)}
    n = len(names)
    histogram = np.zeros((n, len(STYLES), CELLS, len(QUANTITIES), BINS))
    square, drivers = np.zeros((n, len(STYLES), CELLS, 2)), np.zeros((n, len(STYLES)), np.int64)
    km, collisions = np.zeros(n), np.zeros(n, np.int64)
    for done, scene in enumerate(corpus, start=1):
        block = place[block_of[scene.scene_id]]
        _add(scene, judge, histogram[block], square[block], drivers[block])
        step = np.hypot(*np.moveaxis(np.diff(scene.tracks.position_m.astype(np.float64), axis=1), -1, 0))
        km[block] += float(np.nansum(step[scene.tracks.is_motor])) / 1000.0
        collisions[block] += sum(_between_vehicles(scene, one.first, one.second) for one in collisions_of(scene)[0])
        if progress is not None:
            progress(done, len(corpus))
    if not histogram.any():
        raise InputError(f"{corpus.path}: no motor vehicle moves in it, there is nothing to compare")
    return Profile(name or corpus.path.name, names, within, histogram, square, drivers, km, collisions)


def _blocks(infos: tuple[SceneInfo, ...]) -> tuple[dict[str, str], bool]:
    """The block of each scene: its unit, or a stretch of its unit's time where there are few units."""
    units = sorted({info.unit_id for info in infos})
    if len(units) >= FEW_UNITS:
        if len(units) <= MOST_BLOCKS:
            return {info.scene_id: info.unit_id for info in infos}, False
        return {i.scene_id: f"group {zlib.crc32(i.unit_id.encode()) % MOST_BLOCKS}" for i in infos}, False
    result = {}
    for unit in units:
        own = sorted((i for i in infos if i.unit_id == unit), key=lambda i: (i.start_s, i.scene_id))
        for k, info in enumerate(own):
            result[info.scene_id] = f"{unit}, stretch {k * min(TIME_BLOCKS, len(own)) // len(own)}"
    return result, True


def _between_vehicles(scene: Scene, first: int, second: int) -> bool:
    return bool(scene.tracks.is_motor[first] and scene.tracks.is_motor[second])


def bins_of(value: Float64[np.ndarray, " frame"], quantity: Quantity) -> Int64[np.ndarray, " frame"]:
    """The bin of each value; what lies beyond the span (however far) counts in the first or last."""
    return np.asarray(np.clip((value - quantity.low) / quantity.width, 0, BINS - 1).astype(np.int64))


def _add(
    scene: Scene,
    judge: TDBM,
    histogram: Float64[np.ndarray, "style cell quantity bin"],
    square: Float64[np.ndarray, "style cell 2"],
    drivers: Int64[np.ndarray, " style"],
) -> None:
    """Count the frames of one scene."""
    follow = following(scene, judge.options)
    moving = moving_vehicles(scene, follow)
    if not moving.any():
        return
    labels = judge.label_windows(scene)
    of_agent = dict(zip(labels.agent_id, labels.style.tolist(), strict=True))
    style = np.array([of_agent.get(a, -1) for a in scene.tracks.agent_id]) % len(STYLES)  # -1: the last, undetermined
    np.add.at(drivers, style[moving.any(axis=1)], 1)
    place = style[:, None] * CELLS + cells_of(scene, follow, moving)
    dt_s = scene.tracks.dt_s
    for k, (name, value) in enumerate(quantities_of(scene, follow).items()):
        quantity = QUANTITIES[name]
        use = moving & np.isfinite(value)
        where = bins_of(value[use], quantity)
        flat = np.bincount(place[use] * BINS + where, minlength=len(STYLES) * CELLS * BINS)
        histogram[:, :, k] += dt_s * flat.reshape(len(STYLES), CELLS, BINS)
        if name == "acceleration":
            for column, each in enumerate((np.ones(int(use.sum())), value[use] ** 2)):
                flat_sum = np.bincount(place[use], weights=each, minlength=len(STYLES) * CELLS)
                square[:, :, column] += dt_s * flat_sum.reshape(len(STYLES), CELLS)
