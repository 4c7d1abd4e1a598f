"""What the lights of a Lyft scene show: logged faces that are on or off, with the colours that the map gives them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from jaxtyping import Int8

from stylesim.datasets.lyft_map import LyftMap
from stylesim.signals import Signals, SignalState

# One face at one time [read from a store]; its status is on, off or not known (l5kit: ACTIVE, INACTIVE, UNKNOWN).
FACE = np.dtype([("face_id", "<U16"), ("traffic_light_id", "<U16"), ("traffic_light_face_status", "<f4", (3,))])
ON, OFF, NOT_KNOWN, NOT_LOGGED = 0, 1, 2, 3


def lights_of(
    faces: np.ndarray, frame: np.ndarray, n_frames: int, site: LyftMap, lanes: Collection[str]
) -> Signals | None:
    """A light for each different set of faces that controls lanes of the scene; None where there is none.

    `faces` are rows of FACE, `frame` the frame of each. A light shows the colour of the face that is on. Red with
    yellow is red; other colours together, and none while not every face is known to be off, are unknown.
    """
    groups: dict[tuple[str, ...], list[str]] = {}
    for lane in sorted(lanes):
        if lane in site.faces_of_lane:
            groups.setdefault(site.faces_of_lane[lane], []).append(lane)
    if not groups:
        return None
    number = {name: i for i, name in enumerate(sorted({face for group in groups for face in group}))}
    status = np.full((len(number), n_frames), NOT_LOGGED, np.int8)
    row = np.array([number.get(str(name), -1) for name in faces["face_id"]], np.int64)
    known = row >= 0
    status[row[known], frame[known]] = faces["traffic_light_face_status"][known].argmax(axis=1)
    shown = [
        _shown(status[[number[face] for face in group]], [site.colour[face] for face in group]) for group in groups
    ]
    return Signals(
        signal_id=tuple("+".join(group) for group in groups),
        lane_id=tuple(tuple(lanes_of) for lanes_of in groups.values()),
        state=np.stack(shown),
    )


def _shown(status: Int8[np.ndarray, "face time"], colours: list[SignalState]) -> Int8[np.ndarray, " time"]:
    on = {
        colour: (status[[c == colour for c in colours]] == ON).any(axis=0)
        for colour in (SignalState.RED, SignalState.YELLOW, SignalState.GREEN, SignalState.UNKNOWN)
    }
    result = np.full(status.shape[1], int(SignalState.UNKNOWN), np.int8)
    result[(status == OFF).all(axis=0)] = int(SignalState.DARK)
    several = sum(there.astype(int) for there in on.values()) > 1
    for colour in (SignalState.GREEN, SignalState.YELLOW, SignalState.RED):
        result[on[colour] & ~several] = int(colour)
    only = on[SignalState.RED] & on[SignalState.YELLOW] & ~on[SignalState.GREEN] & ~on[SignalState.UNKNOWN]
    result[only] = int(SignalState.RED)
    return result
