"""The lights of a highway-env scenario as an environment reports them; a scenario without lights has none of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int8

from stylesim.envs.highway_ego import EgoVehicle
from stylesim.envs.world import DECIDED_GO, DECIDED_STOP, NO_DECISION
from stylesim.road import Lane, Road
from stylesim.signals import SignalState
from stylesim.simulation.highway.lanes import lane_id
from stylesim.simulation.highway.lights import Lights
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.tracks import TrackFlag


class SeenLights:
    """What the lights show and since when, who decided what, and which egos run them at red."""

    def __init__(self, lights: Lights | None) -> None:
        self._lights = lights
        self._shown, self._steps = SignalState.UNKNOWN, 0

    def after_step(self, egos: Sequence[EgoVehicle]) -> None:
        """Take in a simulation step."""
        lights = self._lights
        if lights is None:
            return
        if lights.shown != self._shown:
            self._shown, self._steps = lights.shown, 0
        self._steps += 1
        for ego in egos:
            if self.flagged(ego, TrackFlag.RAN_RED):
                lights.flags[ego.driver_id] &= ~TrackFlag.RAN_RED  # the next one counts anew
                ego.reds_run += 1

    def flagged(self, car: StyledVehicle, flag: TrackFlag) -> bool:
        """Does the driver carry that flag."""
        return self._lights is not None and bool(self._lights.flags.get(car.driver_id, TrackFlag(0)) & flag)

    def decision(self, car: StyledVehicle) -> int:
        """What the driver decided at a yellow (who did both at two of them counts as stopping)."""
        if self.flagged(car, TrackFlag.DECIDED_STOP):
            return DECIDED_STOP
        return DECIDED_GO if self.flagged(car, TrackFlag.DECIDED_GO) else NO_DECISION

    def states(self) -> Int8[np.ndarray, " light"]:
        """What each stop line is shown."""
        return np.array([] if self._lights is None else [self._lights.shown] * len(self._lights.lanes), np.int8)

    def stop_lines_m(self, road: Road) -> Float64[np.ndarray, "light 2 2"]:
        """The stop lines, in the order of `states`."""
        lanes = [] if self._lights is None else [road.lane(lane_id(index)) for index in self._lights.lanes]
        return np.array([_stop_line(lane) for lane in lanes], np.float64).reshape(-1, 2, 2)

    def ahead_of(self, ego: EgoVehicle, dt_s: float) -> dict[str, float]:
        """The light ahead of an ego, as in `EgoState`; nothing where there is none."""
        lights = self._lights
        if lights is None:
            return {}
        seen = {"reds_run": float(ego.reds_run)}
        if ego.lane_index in lights.lanes:
            gap = float(ego.lane.length - ego.lane.local_coordinates(ego.position)[0]) - ego.LENGTH / 2
            seen |= {"signal_state": float(lights.shown), "stop_line_m": gap, "since_onset_s": self._steps * dt_s}
        return seen


def _stop_line(lane: Lane) -> Float64[np.ndarray, "2 2"]:
    """The lane's own, or square to its end."""
    if lane.stop_line_m is not None:
        return lane.stop_line_m.astype(np.float64)
    end = lane.centre_line_m[-1].astype(np.float64)
    along = end - lane.centre_line_m[-2]
    left = np.array([-along[1], along[0]]) / np.hypot(*along) * lane.width_m / 2
    return np.stack([end - left, end + left])
