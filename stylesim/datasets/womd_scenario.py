"""A `Scenario` proto of Waymo Open Motion (waymo_open_dataset/protos/scenario.proto) as a `Scene`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int64

from stylesim.datasets import wire
from stylesim.datasets.accounting import row_counts
from stylesim.datasets.clocks import refuse_irregular
from stylesim.datasets.dense import checked_tracks, origin_of, size_when_seen
from stylesim.datasets.light_states import WAYMO
from stylesim.datasets.polyline_map import road_of
from stylesim.datasets.womd_map import map_of, points
from stylesim.errors import InputError
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.tracks import AgentKind, TrackFlag

SOURCE = "womd"
DT_S = 0.1
KINDS = {1: AgentKind.CAR, 2: AgentKind.PEDESTRIAN, 3: AgentKind.BICYCLE}  # Track.ObjectType; all others OTHER
MAX_FRAMES, MAX_AGENTS = 10_000, 10_000  # chosen: a scenario has 91 frames and some hundred agents

_DOUBLES = ("center_x", "center_y", "center_z")  # fields 2 to 4
_FLOATS = ("length", "width", "height", "heading", "velocity_x", "velocity_y")  # fields 5 to 10
# An ObjectState in which every field is there, in order: tag and number, nine times, then tag and `valid`.
_STATE = np.dtype(
    [
        *((part, kind) for name in _DOUBLES for part, kind in ((f"{name}_tag", "u1"), (name, "<f8"))),
        *((part, kind) for name in _FLOATS for part, kind in ((f"{name}_tag", "u1"), (name, "<f4"))),
        ("valid_tag", "u1"),
        ("valid", "u1"),
    ]
)
_TAGS = (0x11, 0x19, 0x21, 0x2D, 0x35, 0x3D, 0x45, 0x4D, 0x55, 0x58)
# Nearly all others: those who are not seen have a height, which is not read, and `valid`.
_ABSENT = np.dtype([("z_tag", "u1"), ("z", "<f8"), ("valid_tag", "u1"), ("valid", "u1")])
_VALUES = (*_DOUBLES, *_FLOATS, "valid")


def scene_of_scenario(data: bytes, message: wire.Fields, file: Path, split: str) -> Scene:
    """The scene of one record. InputError, or what bad bytes raise, where it is damaged."""
    scenario_id = wire.text(data, message, 5)
    times = wire.doubles(data, message, 1)
    t0 = wire.integer(message, 10)
    if not scenario_id or not times or not message.get(2):
        raise ValueError("it has no scenario_id, timestamps or tracks")
    if not 0 <= t0 < len(times) or len(times) > MAX_FRAMES or len(message[2]) > MAX_AGENTS:
        raise ValueError(f"{len(times)} timestamps, {len(message[2])} tracks, current time {t0}")
    refuse_irregular(times, DT_S, file)
    ids, kinds, state = _tracks(data, wire.spans(message, 2), len(times))
    position, valid = np.stack([state["center_x"], state["center_y"]], -1), state["valid"] != 0
    origin = origin_of(position, valid)
    size = np.stack([state["length"], state["width"]], -1).astype(np.float64)
    tracks, dropped = checked_tracks(
        agent_id=ids,
        kind=np.array([int(KINDS.get(kind, AgentKind.OTHER)) for kind in kinds]),
        size_m=size_when_seen(size, valid, t0),
        position_m=position,
        velocity_mps=np.stack([state["velocity_x"], state["velocity_y"]], -1).astype(np.float64),
        heading_rad=state["heading"].astype(np.float64),
        valid=valid,
        dt_s=DT_S,
        origin_m=origin,
        file=file,
        flags=_flags(data, message, len(ids)),
    )
    features = map_of(data, wire.spans(message, 8))
    signals, stops = _signals(data, wire.spans(message, 7), len(times))
    features.stops.update(stops)
    return Scene(
        scene_id=f"womd_{scenario_id}",
        unit_id=f"womd_{scenario_id}",
        source=SOURCE,
        scenario="womd",
        tracks=tracks,
        road=road_of(features, origin) if features.lanes else None,
        signals=signals,
        source_scenario_id=scenario_id,
        official_split=split,
        t0_frame=t0,
        counts=row_counts(rows_in=int(valid.sum()), rows_out=int(tracks.valid.sum()), dropped=dropped),
    )


def _tracks(data: bytes, found: list[wire.Span], n_frames: int) -> tuple[list[str], list[int], dict[str, np.ndarray]]:
    ids, kinds, where = [], [], []
    for span in found:
        track, states = wire.split(data, span, 3)
        if len(states) != n_frames:
            raise ValueError(f"a track has {len(states)} states for {n_frames} timestamps")
        ids.append(str(wire.integer(track, 1)))
        kinds.append(wire.integer(track, 2))
        where.append(states)
    if len(set(ids)) != len(ids):
        raise ValueError("two tracks have one id")
    columns = _states(data, np.concatenate(where))
    return ids, kinds, {name: column.reshape(len(ids), n_frames) for name, column in columns.items()}


def _states(data: bytes, where: Int64[np.ndarray, "state 2"]) -> dict[str, np.ndarray]:
    """Every state's values, one column each; NaN where a field is missing."""
    rows, same = wire.fixed(data, where, _STATE)
    regular = np.ones(len(rows), bool)
    for name, tag in zip(_VALUES, _TAGS, strict=True):
        regular &= rows[f"{name}_tag"] == tag
    same[same] = regular
    values = {name: np.full(len(where), np.nan) for name in _VALUES}
    for name in _VALUES:
        values[name][same] = rows[name][regular]
    absent, short = wire.fixed(data, where, _ABSENT)
    short[short] = (absent["z_tag"] == _TAGS[2]) & (absent["valid_tag"] == _TAGS[-1]) & (absent["valid"] == 0)
    values["valid"][short] = 0
    for i in np.flatnonzero(~(same | short)).tolist():
        state = wire.fields(data, (int(where[i, 0]), int(where[i, 1])))
        values["valid"][i] = wire.integer(state, 11)
        if not values["valid"][i]:
            continue  # nothing is read from what is not valid
        for number, name in enumerate(_VALUES, start=2):
            if name != "valid":
                values[name][i] = wire.real(data, state, number)
    return values


def _flags(data: bytes, message: wire.Fields, n_agents: int) -> np.ndarray:
    flags = np.zeros(n_agents, np.int32)
    ego = wire.integer(message, 6, -1)
    if 0 <= ego < n_agents:
        flags[ego] |= int(TrackFlag.EGO)
    for span in wire.spans(message, 11):
        index = wire.integer(wire.fields(data, span), 1, -1)
        if not 0 <= index < n_agents:
            raise ValueError(f"the track to predict {index} is not there")
        flags[index] |= int(TrackFlag.FOCAL)
    return flags


def _signals(data: bytes, steps: list[wire.Span], n_frames: int) -> tuple[Signals | None, dict[str, Any]]:
    """One light for each controlled lane, and where it makes the lane stop."""
    if len(steps) not in (0, n_frames):
        raise InputError(f"{len(steps)} dynamic map states for {n_frames} timestamps")
    shown: dict[str, np.ndarray] = {}
    stops: dict[str, Any] = {}
    for frame, span in enumerate(steps):
        for lane_span in wire.spans(wire.fields(data, span), 1):
            entry = wire.fields(data, lane_span)
            lane = str(wire.integer(entry, 1))
            number = wire.integer(entry, 2)
            if number not in WAYMO:
                raise ValueError(f"{number} is no state of a traffic light")
            if lane not in shown:
                shown[lane] = np.full(n_frames, int(SignalState.UNKNOWN), np.int8)
                where = wire.spans(entry, 3)
                if where:
                    stops[lane] = points(data, where[-1:])[0]
            shown[lane][frame] = int(WAYMO[number])
    return signals_of(shown), stops


def signals_of(shown: dict[str, np.ndarray]) -> Signals | None:
    """The lights of lanes, each named after its lane; None where there are none."""
    if not shown:
        return None
    return Signals(signal_id=tuple(shown), lane_id=tuple((lane,) for lane in shown), state=np.stack([*shown.values()]))
