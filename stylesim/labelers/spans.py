"""Track windows and history windows: which rows, and which of the fitted lengths judges them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Int

from stylesim.errors import InputError, unknown
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows, history_rows, track_rows
from stylesim.scene import Scene

SPANS = ("track", "history")
# Lengths that agree so well are the same: clocks differ by less than a frame.
SAME_LENGTH_S = 0.051


@runtime_checkable
class OfLength(Protocol):
    """Something fitted for windows of one length."""

    @property
    def length_s(self) -> float:
        """The length in seconds."""


Fitted = TypeVar("Fitted", bound=OfLength)


def fitted_length(fitted: Sequence[Fitted], length_s: float) -> Fitted:
    """The one that was fitted for that length. InputError, naming those that there are, if none was."""
    for one in fitted:
        if abs(one.length_s - length_s) <= SAME_LENGTH_S:
            return one
    lengths = ", ".join(f"{one.length_s:g}" for one in fitted) or "none"
    raise InputError(
        f"no scaler for histories of {length_s:g} s; this labeller was fitted for (s): {lengths}. "
        f"Fit it with history_s=({length_s:g},)."
    )


def rows_of(
    scene: Scene,
    options: FeatureOptions,
    starts: Sequence[int] | None,
    length_steps: int | None,
    *,
    span: str,
    agents: Int[np.ndarray, " driver"] | None,
) -> DriverRows:
    """The rows that `label_windows` judges: one per driver (track) or per driver and start (history)."""
    if span not in SPANS:
        raise unknown("span", span, SPANS)
    if span == "track":
        return track_rows(scene, options, starts=starts, length_steps=length_steps, agents=agents)
    if starts is None or length_steps is None or not len(starts):
        raise InputError("history labels need the starts of their windows and length_steps")
    return history_rows(scene, starts, length_steps, options, agents=agents)
