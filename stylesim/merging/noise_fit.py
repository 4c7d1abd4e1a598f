"""Which tracks a merge fits its noise on: the recorded ones of the training split."""

from __future__ import annotations

from collections.abc import Sequence

from stylesim.corpus import Corpus
from stylesim.datasets.formats import FORMATS
from stylesim.errors import InputError
from stylesim.merging.clock import on_common_clock
from stylesim.merging.noise import NoiseFit, NoiseModel
from stylesim.merging.splits import SplitPlan


def recorded_sources() -> frozenset[str]:
    """Names of the sources that are recordings: the formats that can be read. All others are simulators."""
    return frozenset(FORMATS)


def train_noise(inputs: Sequence[Corpus], splits: SplitPlan) -> tuple[NoiseModel, ...]:
    """One model for each recorded source in the training split, by name. InputError where there is none."""
    fits: dict[str, NoiseFit] = {}
    for number, corpus in enumerate(inputs):
        train = {scene_id for (n, scene_id), name in splits.split.items() if n == number and name == "train"}
        recorded = [i for i in corpus.info if i.source in recorded_sources() and i.scene_id in train]
        for scene in corpus.with_info(recorded):
            fits.setdefault(scene.source, NoiseFit(scene.source)).add(on_common_clock(scene))
    if not fits:
        raise InputError("noise can only be fitted on recorded tracks, and none is in the training split")
    return tuple(fits[source].model() for source in sorted(fits))
