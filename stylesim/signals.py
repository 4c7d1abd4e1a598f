"""`Signals`: the state of every traffic light, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from jaxtyping import Int

from stylesim.arrays import frozen


class SignalState(IntEnum):
    """What a light shows. The numbers are part of the on-disk format. Red with amber counts as RED."""

    UNKNOWN = 0
    DARK = 1
    GREEN = 2
    YELLOW = 3
    RED = 4


@dataclass(frozen=True, eq=False)
class Signals:
    """The lights of one scene on the clock of its tracks; `lane_id[i]` are the lanes that light i controls."""

    signal_id: tuple[str, ...]
    lane_id: tuple[tuple[str, ...], ...]  # empty: the link of light and lane is unknown
    state: Int[np.ndarray, "signal time"]

    def __post_init__(self) -> None:
        """Check shapes and states, freeze the array."""
        n = len(self.signal_id)
        if len(self.lane_id) != n:
            raise ValueError(f"lane_id has {len(self.lane_id)} entries for {n} signals")
        if len(set(self.signal_id)) != n:
            raise ValueError("signal_id has duplicates")
        state = frozen(self.state, np.int8, (n, None), "state")
        if state.size and not 0 <= int(state.min()) <= int(state.max()) <= max(SignalState):
            raise ValueError("state holds a number that is no SignalState")
        object.__setattr__(self, "state", state)

    def frames(self, start: int, stop: int) -> Signals:
        """The frames [start, stop) of every light."""
        return replace(self, state=self.state[:, start:stop])
