"""Logs of lights as rows (time, light, state) into a `SignalLog`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.recording import SignalLog
from stylesim.signals import SignalState

# Movement states of SAE J2735 (and ISO 19091) [read], without their hyphens and underscores.
MOVEMENT_STATES: Mapping[str, SignalState] = {
    "unavailable": SignalState.UNKNOWN,
    "dark": SignalState.DARK,
    "stopthenproceed": SignalState.RED,
    "stopandremain": SignalState.RED,
    "premovement": SignalState.RED,  # red with amber: no one may go yet
    "permissivemovementallowed": SignalState.GREEN,
    "protectedmovementallowed": SignalState.GREEN,
    "permissiveclearance": SignalState.YELLOW,
    "protectedclearance": SignalState.YELLOW,
    "cautionconflictingtraffic": SignalState.UNKNOWN,  # flashing: neither go nor stop
}


def movement_state(text: str) -> SignalState:
    """The state that such a name says; UNKNOWN for other names."""
    key = text.strip().lower().replace("_", "").replace("-", "")
    return MOVEMENT_STATES.get(key, SignalState.UNKNOWN)


def held_log(
    time_s: Float64[np.ndarray, " row"], light: Sequence[str], state: Sequence[SignalState], *, stale_s: float
) -> SignalLog:
    """The log of those rows: a light holds what it was last said to show, for `stale_s` at most.

    Lights are ordered by the length of their name, then by name, so that 10 comes after 9.
    """
    names = sorted(set(light), key=lambda name: (len(name), name))
    number = {name: i for i, name in enumerate(names)}
    times, event = np.unique(time_s, return_inverse=True)
    said = np.full((len(names), len(times)), -1, np.int8)
    said[[number[name] for name in light], event] = [int(s) for s in state]
    last = np.maximum.accumulate(np.where(said >= 0, np.arange(len(times)), -1), axis=1)
    held = np.take_along_axis(said, np.maximum(last, 0), axis=1)
    fresh = (last >= 0) & (times[None] - times[np.maximum(last, 0)] <= stale_s)
    shown = np.where(fresh, held, np.int8(SignalState.UNKNOWN)).astype(np.int8)
    return SignalLog(time_s=times, signal_id=tuple(names), state=shown, stale_s=stale_s)
