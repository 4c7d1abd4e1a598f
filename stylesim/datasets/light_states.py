"""Names and numbers of light states that Waymo Open Motion and its descendants use."""

from __future__ import annotations

from typing import Any

from stylesim.signals import SignalState

# waymo_open_dataset/protos/map.proto, TrafficSignalLaneState.State, by number. A flashing light controls like a sign,
# not by time; its state is unknown here.
WAYMO = {
    0: SignalState.UNKNOWN,
    1: SignalState.RED,
    2: SignalState.YELLOW,
    3: SignalState.GREEN,
    4: SignalState.RED,
    5: SignalState.YELLOW,
    6: SignalState.GREEN,
    7: SignalState.UNKNOWN,
    8: SignalState.UNKNOWN,
}
_NAMES = {
    "UNKNOWN": SignalState.UNKNOWN,
    "ARROW_STOP": SignalState.RED,
    "ARROW_CAUTION": SignalState.YELLOW,
    "ARROW_GO": SignalState.GREEN,
    "STOP": SignalState.RED,
    "CAUTION": SignalState.YELLOW,
    "GO": SignalState.GREEN,
    "FLASHING_STOP": SignalState.UNKNOWN,
    "FLASHING_CAUTION": SignalState.UNKNOWN,
    # MetaDrive's own names
    "RED": SignalState.RED,
    "YELLOW": SignalState.YELLOW,
    "GREEN": SignalState.GREEN,
    "NONE": SignalState.UNKNOWN,
}


def light_state(value: Any) -> SignalState:
    """The state for a number of Waymo's enumeration or a name ("LANE_STATE_STOP", "arrow_go", "TRAFFIC_LIGHT_RED").

    None is unknown. ValueError for what is no such state.
    """
    if value is None:
        return SignalState.UNKNOWN
    if isinstance(value, str):
        name = value.upper().removeprefix("LANE_STATE_").removeprefix("TRAFFIC_LIGHT_")
        if name in _NAMES:
            return _NAMES[name]
    elif float(value) in WAYMO:
        return WAYMO[int(value)]
    raise ValueError(f"{value!r} is no state of a traffic light")
