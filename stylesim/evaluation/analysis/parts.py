"""Training and held-out part of a corpus: its own split, else by unit, else by time."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from stylesim.corpus import Corpus
from stylesim.corpus.corpus import SceneInfo
from stylesim.evaluation.intervals import MIN_UNITS

TRAIN, HELD_OUT = "train", "held out"
SEVERAL = "several"  # of a driver who is in more than one part
TRAIN_SHARE = 0.7  # chosen: a held-out part large enough to be described


def parts_of(corpus: Corpus, *, seed: int) -> tuple[Callable[[SceneInfo], str], str]:
    """The part of each scene, and how the parts were made.

    "official": the corpus' split, or the source's own, where it has a training and another part. "by unit": with at
    least 2 x 3 units, seeded. "within recording": the first 70 % of the scenes by time against the rest; who drives
    in both is in neither.
    """
    for kind in ("split", "official_split"):
        names = {str(getattr(one, kind)) for one in corpus.info}
        if TRAIN in names and len(names - {"", TRAIN}) >= 1:
            return (lambda one, kind=kind: str(getattr(one, kind)) or "no part"), "official"
    units = sorted({one.unit_id for one in corpus.info}, key=lambda unit: _place(unit, seed))
    if len(units) >= 2 * MIN_UNITS:
        first = set(units[: max(MIN_UNITS, min(len(units) - MIN_UNITS, round(TRAIN_SHARE * len(units))))])
        return (lambda one: TRAIN if one.unit_id in first else HELD_OUT), "by unit"
    scenes = sorted(corpus.info, key=lambda one: (one.start_s, one.unit_id, one.scene_id))
    early = {one.scene_id for one in scenes[: round(TRAIN_SHARE * len(scenes))]}
    return (lambda one: TRAIN if one.scene_id in early else HELD_OUT), "within recording"


def _place(unit: str, seed: int) -> str:
    return hashlib.sha256(f"{seed}\n{unit}".encode()).hexdigest()


def held_out_of(parts: set[str]) -> list[str]:
    """The parts that are compared with the training part, in the order in which they are usually named."""
    return [name for name in ("val", "test", HELD_OUT) if name in parts]
