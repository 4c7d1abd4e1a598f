"""Labellers that are fitted once for all runs of an experiment, and judge each history once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Int32, Int64

from stylesim.corpus import Corpus
from stylesim.experiments.arms import Arm
from stylesim.forecasting.conditioner import Judges
from stylesim.forecasting.conditions import NO_CONDITION, condition_of
from stylesim.forecasting.judging import LabelerJudges
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.truth import TrackJudges
from stylesim.scene import Scene
from stylesim.windows import WindowSpec


@runtime_checkable
class AllJudges(Judges, TrackJudges, Protocol):
    """Judges of histories and of whole tracks."""


class Remembered:
    """`judges` that keep what they said: runs of other seeds ask them about the same histories."""

    def __init__(self, judges: AllJudges) -> None:
        self._judges = judges
        self._said: dict[tuple[Any, ...], Measured] = {}
        self._tracks: dict[tuple[Any, ...], Int64[np.ndarray, " driver"]] = {}

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the styles."""
        return self._judges.classes

    def measure(self, history: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Measured:
        """As `LabelerJudges.measure`."""
        key = _key(history, agent_index)
        if key not in self._said:
            self._said[key] = self._judges.measure(history, agent_index)
        return self._said[key]

    def whole_track(self, scene: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Int64[np.ndarray, " driver"]:
        """As `LabelerJudges.whole_track`."""
        key = _key(scene, agent_index)
        if key not in self._tracks:
            self._tracks[key] = self._judges.whole_track(scene, agent_index)
        return self._tracks[key]

    def to_dict(self) -> Mapping[str, Any]:
        """As `LabelerJudges.to_dict`."""
        return self._judges.to_dict()


def _key(scene: Scene, agent_index: Int32[np.ndarray, " driver"]) -> tuple[Any, ...]:
    """What tells one question from another, also where two corpora have scenes of one name."""
    tracks = scene.tracks
    seen = tracks.position_m[agent_index].tobytes()
    return scene.scene_id, scene.start_s, tracks.n_frames, agent_index.tobytes(), hash(seen)


class JudgeShelf:
    """One `Remembered` per method and training corpus."""

    def __init__(self) -> None:
        self._judges: dict[tuple[str, str], Remembered] = {}

    def options(self, arm: Arm, corpus: Corpus, spec: WindowSpec) -> dict[str, Any]:
        """The arm's options, with judges where it has a condition and brings none of its own."""
        condition = str(arm.options.get("condition", NO_CONDITION))
        if condition == NO_CONDITION or "judges" in arm.options:
            return dict(arm.options)
        method = condition_of(condition).method
        key = method, corpus.fingerprint
        if key not in self._judges:
            self._judges[key] = Remembered(LabelerJudges.fit(method, corpus.split("train"), spec))
        return {**arm.options, "judges": self._judges[key]}
