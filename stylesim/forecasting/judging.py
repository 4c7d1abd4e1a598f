"""`LabelerJudges`: the labellers of `stylesim.labelers` as the source of `style_cond`. No torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int32, Int64

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.forecasting.measured import Measured
from stylesim.labelers.base import Labeler, Progress
from stylesim.labelers.history import history_labels
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import UNDETERMINED
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES
from stylesim.windows import WindowSpec

STYLE_METHODS = ("tdbm", "kdsc")


@dataclass(frozen=True, eq=False)
class LabelerJudges:
    """Two fitted labellers, both for histories of `history_s`: `style` gives the class, `kinematic` (KDSC) features.

    For condition "kdsc" they are one object.
    """

    style: Labeler
    kinematic: KDSC
    classes: tuple[str, ...]
    history_s: float

    @classmethod
    def fit(cls, condition: str, train: Corpus, spec: WindowSpec, *, progress: Progress | None = None) -> LabelerJudges:
        """Labellers fitted on the training split, for histories as long as the model's."""
        if condition not in STYLE_METHODS:
            raise unknown("style method", condition, STYLE_METHODS)
        kinematic = KDSC(history_s=(spec.history_s,)).fit(train, progress=progress)
        if condition == "kdsc":
            return cls(kinematic, kinematic, tuple(kinematic.names), spec.history_s)
        style = TDBM(history_s=(spec.history_s,)).fit(train, progress=progress)
        return cls(style, kinematic, STYLE_CLASSES, spec.history_s)

    def measure(self, history: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Measured:
        """What the history says of these agents; the scene comes from `Scene.history`."""
        kinematic = history_labels(self.kinematic, history, agent_index, history_s=self.history_s)
        if self.style is self.kinematic:
            return Measured.of(kinematic, kinematic)
        style = history_labels(self.style, history, agent_index, history_s=self.history_s)
        return Measured.of(style, kinematic)

    def whole_track(self, scene: Scene, agent_index: Int32[np.ndarray, " driver"]) -> Int64[np.ndarray, " driver"]:
        """The class over the whole scene, future included: for the oracle, and as a target to learn."""
        labels = self.style.label_windows(scene, span="track", agents=agent_index)
        row = {name: number for number, name in enumerate(labels.agent_id)}
        names = (scene.tracks.agent_id[i] for i in agent_index)
        style = np.append(labels.style.astype(np.int64), UNDETERMINED)  # the last: whoever has no row
        return style[[row.get(name, -1) for name in names]]

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types; `style` is None where KDSC is both."""
        return {
            "style": None if self.style is self.kinematic else self.style.to_dict(),
            "kinematic": self.kinematic.to_dict(),
            "classes": list(self.classes),
            "history_s": self.history_s,
        }

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> LabelerJudges:
        """The inverse of `to_dict`; InputError if the labellers are of another schema."""
        try:
            kinematic = KDSC.from_dict(raw["kinematic"])
            style = kinematic if raw["style"] is None else TDBM.from_dict(raw["style"])
            return cls(style, kinematic, tuple(raw["classes"]), float(raw["history_s"]))
        except (KeyError, TypeError) as error:
            raise InputError(f"the checkpoint's labellers are damaged: {error}") from None
