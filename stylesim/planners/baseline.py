"""A planner to start from: follows its lane, keeps its distance by the IDM, stops at the light; changes no lanes."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import arc_length, project
from stylesim.planners.answers import EgoControl
from stylesim.planners.bicycle import EgoState
from stylesim.planners.tracking import steering_to
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.style import DriverStyle
from stylesim.styles import style_table

HORIZON_M = 120.0  # of the path ahead; chosen, because the IDM hardly reacts to what is farther away
COMFORT_LATERAL_MPS2 = 2.0  # in bends; chosen, as the networks' turning speeds
ALIGNED_RAD = math.radians(60)  # a lane is ours if we drive along it
LOST_M = 1.5  # that far beside its lane it looks for another one
CORRIDOR_M = 0.3  # that much beside the ego's width is still in its way


class IdmPlanner:
    """The neutral driver of `agents/styles.yaml` by the Intelligent Driver Model (Treiber et al. 2000 [recalled])."""

    def __init__(self) -> None:
        self._style: DriverStyle = style_table().at(0.0)
        self._lane = ""

    def __call__(self, scene: Scene) -> EgoControl:
        """Pedal by the nearest hindrance ahead, wheel along the lane. A scene without a road: straight on."""
        state = ego_state(scene)
        if scene.road is None or not scene.road.lanes:
            return EgoControl(self._pedal(state.speed_mps, state.speed_mps, []), 0.0)
        lanes = {lane.lane_id: lane for lane in scene.road.lanes}
        lane = self._own_lane(scene.road, lanes, state)
        path, controlled = path_ahead(lane, lanes, state)
        hindrances = [*_leaders(scene, path, state), *self._stop_line(scene, controlled, state)]
        wish = min(_limit(lane), _bend_speed(path)) * self._style.desired_speed_factor
        return EgoControl(self._pedal(state.speed_mps, wish, hindrances), steering_to(path, state))

    def _own_lane(self, road: Road, lanes: dict[str, Lane], state: EgoState) -> Lane:
        """The lane that was followed so far, at its end the straightest one behind it; otherwise the nearest."""
        lane = lanes.get(self._lane)
        while lane is not None and _passed(lane, state) and (onward := _onward(lane, lanes)) is not None:
            lane = onward
        offset = None if lane is None else _offset(lane, state)
        if lane is None or offset is None or offset > LOST_M:
            fitting = [(offset, lane) for lane in road.lanes if (offset := _offset(lane, state)) is not None]
            if not fitting:  # off every road: the lane that is nearest to us, whatever its direction
                away = [float(np.hypot(*(lane.centre_line_m - (state.x, state.y)).T).min()) for lane in road.lanes]
                return road.lanes[int(np.argmin(away))]
            lane = min(fitting, key=lambda item: item[0])[1]
        self._lane = lane.lane_id
        return lane

    def _pedal(self, speed: float, wish: float, hindrances: list[tuple[float, float]]) -> float:
        """The IDM's acceleration before all (gap in m, closing speed in m/s)."""
        style = self._style
        comfort = 2.0 * math.sqrt(style.max_acceleration_mps2 * style.comfortable_deceleration_mps2)
        free = 1.0 - (speed / max(wish, 0.1)) ** 4
        worst = 0.0
        for gap, closing in hindrances:
            wanted = style.min_gap_m + max(0.0, speed * style.time_headway_s + speed * closing / comfort)
            worst = max(worst, (wanted / max(gap, 0.1)) ** 2)
        return max(style.max_acceleration_mps2 * (free - worst), -8.0)

    def _stop_line(
        self, scene: Scene, controlled: list[tuple[float, str]], state: EgoState
    ) -> list[tuple[float, float]]:
        """The next stop line on the path while it is red, or yellow and the comfortable deceleration suffices."""
        if scene.signals is None:
            return []
        shown = {
            lane: SignalState(int(state_now[-1]))
            for lanes, state_now in zip(scene.signals.lane_id, scene.signals.state, strict=True)
            for lane in lanes
        }
        half = float(scene.tracks.size_m[0, 0]) / 2
        for along, lane in controlled:
            gap = along - half
            if lane not in shown or gap < -1.0:
                continue
            soft = state.speed_mps**2 / (2 * max(gap, 0.1)) <= self._style.comfortable_deceleration_mps2
            if shown[lane] == SignalState.RED or (shown[lane] == SignalState.YELLOW and soft):
                return [(gap + self._style.min_gap_m - 1.0, state.speed_mps)]  # it stands 1 m before the line
        return []


def ego_state(scene: Scene) -> EgoState:
    """Where track 0 is in the last frame."""
    tracks = scene.tracks
    x, y = (float(value) for value in tracks.position_m[0, -1])
    speed = float(np.hypot(*tracks.velocity_mps[0, -1]))
    return EgoState(x, y, float(tracks.heading_rad[0, -1]), speed)


def _passed(lane: Lane, state: EgoState) -> bool:
    """Are we at the lane's end."""
    line = lane.centre_line_m.astype(np.float64)
    return bool(_projected(line, state)[0] >= arc_length(line)[-1] - 0.1)


def _onward(lane: Lane, lanes: dict[str, Lane]) -> Lane | None:
    """The straightest of the lanes that follow; None at a road's end."""
    known = [lanes[name] for name in lane.successors if name in lanes]
    return min(known, key=_bend) if known else None


def _offset(lane: Lane, state: EgoState) -> float | None:
    """Distance to the lane's centre line where we are on it and drive along it, else None."""
    _, aside, direction, beyond = _projected(lane.centre_line_m.astype(np.float64), state)
    if beyond > 1.0 or abs(math.remainder(direction - state.heading_rad, 2 * math.pi)) > ALIGNED_RAD:
        return None
    width = 3.5 if math.isnan(lane.width_m) else lane.width_m
    return abs(aside) if abs(aside) <= width else None


def _projected(line: Float64[np.ndarray, "point 2"], state: EgoState) -> tuple[float, float, float, float]:
    """(along, offset to the left, direction of the line there, how far beyond its ends we are)."""
    along, aside, away, segment = project(np.array([[state.x, state.y]]), line)
    piece = line[segment[0] + 1] - line[segment[0]]
    beyond = math.sqrt(max(float(away[0]) ** 2 - float(aside[0]) ** 2, 0.0))
    return float(along[0]), float(aside[0]), math.atan2(float(piece[1]), float(piece[0])), beyond


def path_ahead(
    lane: Lane, lanes: dict[str, Lane], state: EgoState
) -> tuple[Float64[np.ndarray, "point 2"], list[tuple[float, str]]]:
    """The centre line from beside the ego on, 120 m or to the road's end, and (distance, lane) of its stop lines."""
    line = lane.centre_line_m.astype(np.float64)
    along = _projected(line, state)[0]
    arc = arc_length(line)
    here = np.array([np.interp(along, arc, line[:, axis]) for axis in (0, 1)])
    points, reached = [here[None], line[arc > along]], float(arc[-1] - along)
    controlled = [(reached, lane.lane_id)] if lane.stop_line_m is not None else []
    while reached < HORIZON_M:
        onward = _onward(lane, lanes)
        if onward is None:
            break
        lane = onward
        line = lane.centre_line_m.astype(np.float64)
        points.append(line[1:])
        reached += float(arc_length(line)[-1])
        if lane.stop_line_m is not None:
            controlled.append((reached, lane.lane_id))
    return np.concatenate(points), controlled


def _bend(lane: Lane) -> float:
    """How much a lane turns; 0 is straight on."""
    first, last = lane.centre_line_m[1] - lane.centre_line_m[0], lane.centre_line_m[-1] - lane.centre_line_m[-2]
    turn = math.atan2(float(last[1]), float(last[0])) - math.atan2(float(first[1]), float(first[0]))
    return abs(math.remainder(turn, 2 * math.pi))


def _limit(lane: Lane) -> float:
    return 13.9 if math.isnan(lane.speed_limit_mps) else lane.speed_limit_mps  # 50 km/h where nothing is said


def _bend_speed(path: Float64[np.ndarray, "point 2"]) -> float:
    """The speed now with which every bend ahead can still be reached at its own, braking with 2 m/s2."""
    if len(path) < 3:
        return math.inf
    pieces = np.diff(path, axis=0)
    length = np.maximum(np.hypot(*pieces.T), 1e-6)
    angle = np.arctan2(pieces[:, 1], pieces[:, 0])
    turn = np.abs(np.remainder(np.diff(angle) + np.pi, 2 * np.pi) - np.pi)
    curvature = turn / np.maximum((length[1:] + length[:-1]) / 2, 0.5)
    at = np.cumsum(length)[:-1]
    bends = np.flatnonzero(curvature > 1e-3)
    squared = COMFORT_LATERAL_MPS2 / curvature[bends] + 2 * 2.0 * np.maximum(at[bends] - 2.0, 0.0)
    return float(np.sqrt(squared.min())) if len(bends) else math.inf


def _leaders(scene: Scene, path: Float64[np.ndarray, "point 2"], state: EgoState) -> list[tuple[float, float]]:
    """(gap, closing speed) of everybody whose centre lies in the ego's corridor along the path."""
    tracks = scene.tracks
    others = np.flatnonzero(tracks.valid[:, -1])[1:]
    if not len(others) or len(path) < 2:
        return []
    place = tracks.position_m[others, -1].astype(np.float64)
    along, aside = project(place, path)[:2]
    width = (tracks.size_m[others, 1] + tracks.size_m[0, 1]) / 2 + CORRIDOR_M
    length = (tracks.size_m[others, 0] + tracks.size_m[0, 0]) / 2
    found = []
    for k in np.flatnonzero((np.abs(aside) < width) & (along > 0.5)):
        i = int(np.clip(np.searchsorted(arc_length(path), along[k]) - 1, 0, len(path) - 2))
        direction = (path[i + 1] - path[i]) / max(float(np.hypot(*(path[i + 1] - path[i]))), 1e-9)
        pace = float(tracks.velocity_mps[others[k], -1].astype(np.float64) @ direction)
        found.append((float(along[k] - length[k]), state.speed_mps - pace))
    return found
