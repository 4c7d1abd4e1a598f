"""`Recording`: one continuous recording as a long table, the form between a foreign file and scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int8, Int64

from stylesim.signals import SignalState

NEVER = 32767  # lookahead of an interpolated row that no real detection follows: known at no t0 of a scene


@dataclass(frozen=True, eq=False)
class SignalLog:
    """What the lights showed, as logged on a clock of their own (seconds on the recording's clock, ascending)."""

    time_s: Float64[np.ndarray, " event"]
    signal_id: tuple[str, ...]
    state: Int8[np.ndarray, "signal event"]
    stale_s: float  # a state older than this is unknown
    lane_id: tuple[tuple[str, ...], ...] = ()  # the lanes that each light controls; empty: no link is known

    def at(self, time_s: Float64[np.ndarray, " time"]) -> Int8[np.ndarray, "signal time"]:
        """The state last logged at or before each time; UNKNOWN before the first log and where it is stale.

        The nearest *earlier* log, never a later one: a state at t0 must not know what the light does next.
        """
        index = np.searchsorted(self.time_s, time_s, side="right") - 1
        known = index >= 0
        known[known] = time_s[known] - self.time_s[index[known]] <= self.stale_s
        state = self.state[:, np.maximum(index, 0)]
        return np.where(known[None, :], state, np.int8(SignalState.UNKNOWN)).astype(np.int8)


@dataclass(frozen=True, eq=False)
class Recording:
    """One row per (agent, frame), sorted by agent, then frame; no pair twice.

    Frame f is at `f * dt_s` on the recording's clock; positions are in the source's own frame, in metres.
    `lookahead` is how many frames later the next real detection is on which the row depends: 0 for a row that
    was detected itself, NEVER where none follows. `dropped` are source rows that are not here, by reason.
    """

    recording_id: str
    agent_id: tuple[str, ...]
    kind: Int8[np.ndarray, " agent"]
    size_m: Float32[np.ndarray, "agent 2"]
    agent: Int64[np.ndarray, " row"]  # index into agent_id
    frame: Int64[np.ndarray, " row"]
    position_m: Float64[np.ndarray, "row 2"]
    velocity_mps: Float64[np.ndarray, "row 2"]
    heading_rad: Float64[np.ndarray, " row"]
    lookahead: Int64[np.ndarray, " row"]
    dt_s: float
    signals: SignalLog | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: Mapping[str, int] = field(default_factory=dict)  # other counts worth keeping

    def __post_init__(self) -> None:
        """Check the order that everything else relies on."""
        step = np.diff(self.agent)
        if (step < 0).any() or (np.diff(self.frame)[step == 0] <= 0).any():
            raise ValueError(f"{self.recording_id}: rows are not sorted by agent and frame, or a pair is there twice")


def lookahead_of(
    agent: Int64[np.ndarray, " row"], frame: Int64[np.ndarray, " row"], interpolated: Bool[np.ndarray, " row"]
) -> Int64[np.ndarray, " row"]:
    """Frames from each row to the next row of its agent that was really detected (0: the row itself).

    Rows are sorted by agent, then frame. NEVER where no detection follows.
    """
    n = len(agent)
    following = np.where(interpolated, n, np.arange(n))
    following = np.minimum.accumulate(following[::-1])[::-1]
    inside = following < n
    inside[inside] = agent[following[inside]] == agent[inside]
    ahead = np.full(n, NEVER, np.int64)
    ahead[inside] = frame[following[inside]] - frame[inside]
    return np.minimum(ahead, NEVER)
