"""`StyleLabels`: one method's verdict on every (scene, agent), with scores, features and flags."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntFlag
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from stylesim.arrays import frozen

UNDETERMINED = -1  # `style` where a feature that the class needs cannot be known


class LabelFlag(IntFlag):
    """What a label leaned on. The bits are part of the on-disk format."""

    NO_NEIGHBOURS = 1
    NO_LEADER = 2
    NO_LANE = 4
    SHORT = 8
    HIGHWAY = 16  # the context that the scaler was chosen by
    CLAMPED = 32  # at least one feature lay outside the scaler's range
    IMPLAUSIBLE = 64


@dataclass(frozen=True, eq=False)
class StyleLabels:
    """Labels of one method and one span, one row per (scene, agent) or (scene, agent, t0).

    `span` is "track" (whole track: windows averaged per driver; may stratify, must never condition) or
    "history" (frames [start_frame, stop_frame) that end at t0 = stop_frame - 1; may condition).
    """

    method: str
    span: str
    classes: tuple[str, ...]
    feature_names: tuple[str, ...]
    scene_id: tuple[str, ...]
    agent_id: tuple[str, ...]
    start_frame: Int[np.ndarray, " row"]
    stop_frame: Int[np.ndarray, " row"]
    score: Float[np.ndarray, "row style"]
    style: Int[np.ndarray, " row"]  # index into classes, or UNDETERMINED
    margin: Float[np.ndarray, " row"]  # best score minus second best
    aggressiveness: Float[np.ndarray, " row"]  # the measured `a`; NaN where undetermined
    feature: Float[np.ndarray, "row feature"]  # SI units; NaN where missing
    missing: Bool[np.ndarray, "row feature"]
    flags: Int[np.ndarray, " row"]
    score_transposed: Float[np.ndarray, "row other"] | None = None  # TDBM's other reading
    style_transposed: Int[np.ndarray, " row"] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)  # JSON-able: scaler hash, options

    def __post_init__(self) -> None:
        """Check lengths and classes, freeze the arrays."""
        n, c, f = len(self.scene_id), len(self.classes), len(self.feature_names)
        if self.span not in ("track", "history"):
            raise ValueError(f"span is 'track' or 'history', not {self.span!r}")
        if len(self.agent_id) != n:
            raise ValueError(f"agent_id has {len(self.agent_id)} entries for {n} rows")
        shapes: dict[str, tuple[type, tuple[int | None, ...]]] = {
            "start_frame": (np.int32, (n,)),
            "stop_frame": (np.int32, (n,)),
            "score": (np.float32, (n, c)),
            "style": (np.int8, (n,)),
            "margin": (np.float32, (n,)),
            "aggressiveness": (np.float32, (n,)),
            "feature": (np.float32, (n, f)),
            "missing": (np.bool_, (n, f)),
            "flags": (np.int32, (n,)),
        }
        if self.score_transposed is not None:
            shapes["score_transposed"] = (np.float32, (n, c))
            shapes["style_transposed"] = (np.int8, (n,))
        for name, (dtype, shape) in shapes.items():
            object.__setattr__(self, name, frozen(getattr(self, name), dtype, shape, name))
        if n and not -1 <= int(self.style.min()) <= int(self.style.max()) < c:
            raise ValueError("style holds an index outside classes")

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.scene_id)

    def rows(self, index: Int[np.ndarray, " chosen"]) -> StyleLabels:
        """The labels of the chosen rows, in that order."""
        names = (
            "start_frame",
            "stop_frame",
            "score",
            "style",
            "margin",
            "aggressiveness",
            "feature",
            "missing",
            "flags",
        )
        chosen: dict[str, Any] = {name: getattr(self, name)[index] for name in names}
        for name in ("score_transposed", "style_transposed"):
            other = getattr(self, name)
            chosen[name] = None if other is None else other[index]
        for name in ("scene_id", "agent_id"):
            ids = getattr(self, name)
            chosen[name] = tuple(ids[i] for i in index)
        return replace(self, **chosen)

    def class_name(self, row: int) -> str:
        """Name of the class of that row, or "undetermined"."""
        index = int(self.style[row])
        return "undetermined" if index == UNDETERMINED else self.classes[index]
