"""A planner's vehicle in SUMO: a driver's place taken over, a bicycle's path put onto SUMO's roads step by step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.geometry import resampled
from stylesim.planners.answers import EGO_ID
from stylesim.planners.bicycle import LENGTH_M, WIDTH_M, EgoState, moved
from stylesim.planners.driving import EgoDriver
from stylesim.planners.outcome import with_ego_flags, with_ego_track
from stylesim.planners.seen import Frame, Place
from stylesim.randomness import stream
from stylesim.scene import Scene
from stylesim.signals import SignalState
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles
from stylesim.simulation.sumo.live import poses_of, shifted
from stylesim.simulation.sumo.live_wander import Wander
from stylesim.simulation.sumo.recorder import EXTRA
from stylesim.simulation.sumo.signals import STATES, main_link
from stylesim.simulation.sumo.takeover import places, take_over
from stylesim.simulation.walkers import Walker
from stylesim.tracks import AgentKind

VEHICLE = f"{EXTRA}{EGO_ID}"  # its id in SUMO; the recorder leaves it to us
AWAY_FROM_ROAD_M = 10.0  # beyond every lane: the ego has left the network, at a road's end or beside it
POINTS_M = 5.0  # spacing of the points of centre lines to which that is measured
EXACTLY = 2  # SUMO's keepRoute: put it there, on a road or beside one


class PlannedEgo:
    """The ego of one episode; call `before_step` ahead of every simulation step, `after_step` behind it.

    It takes over a car when the log begins, or as soon as there is one. Until its end it is where its bicycle says,
    whatever SUMO makes of it; drivers see it where it is on a lane.
    """

    def __init__(self, sumo: Any, files: EpisodeFiles, entry_point: str, *, name: str) -> None:
        self._sumo, self._files = sumo, files
        network = files.network
        self._main = [main_link([i for i in network.links if i.lane == lane]) for lane in network.controlled_lanes()]
        scene_id = f"{name}-{files.seed}-{files.episode:05d}"
        lanes = tuple((link.lane,) for link in self._main)
        lights = tuple(f"{link.signal}:{link.lane}" for link in self._main)
        self._driver = EgoDriver(entry_point, Place(scene_id, "sumo", name, network.road, lights, lanes, DT_S))
        self._centres = np.concatenate([resampled(lane.centre_line_m, POINTS_M) for lane in network.road.lanes])
        self._wander = Wander(files)
        self._number = {driver_id: number for number, driver_id in enumerate(files.drivers)}
        self._first = round(files.warm_up_s / DT_S)
        self._state: EgoState | None = None
        self._gone = False
        self._entry_point = entry_point
        self._rows: list[tuple[float, ...]] = []  # step, x, y, vx, vy, heading
        self._hardest_mps2 = 0.0

    def before_step(self, step: int, walkers: Sequence[Walker] = ()) -> str:
        """Take a place, or go on; ask the planner. Returns the driver whose place was taken in this step, or ""."""
        if step < self._first or self._gone:
            return ""
        replaced = self._enter() if self._state is None else ""
        if self._state is None:
            return ""
        control = self._driver.drive(
            self._frame(self._state, walkers, time_s=(step - 1 - self._first) * DT_S), self._state
        )
        self._hardest_mps2 = min(self._hardest_mps2, control.acceleration_mps2)
        self._state = moved(self._state, control, dt_s=DT_S)
        self._show(self._state)
        return replaced

    def after_step(self, step: int) -> None:
        """Note where the ego is; take it away where it has left the roads."""
        if self._state is None or self._gone:
            return
        vx, vy = self._state.velocity_mps
        self._rows.append((step, self._state.x, self._state.y, vx, vy, self._state.heading_rad))
        apart = self._centres - (self._state.x, self._state.y)
        if float(np.hypot(*apart.T).min()) > AWAY_FROM_ROAD_M:
            self._gone = True
            if VEHICLE in self._sumo.vehicle.getIDList():
                self._sumo.vehicle.remove(VEHICLE)

    def in_scene(self, scene: Scene) -> Scene:
        """The scene of the episode with the ego in it, and what happened to it."""
        rows = np.array(self._rows, np.float64).reshape(-1, 6)
        rows[:, 0] -= self._first
        return with_ego_flags(
            with_ego_track(scene, rows),
            entry_point=self._entry_point,
            hit=self._driver.hit,
            hardest_mps2=self._hardest_mps2,
            counts={
                **self._driver.counts,
                "ego_left_the_network": int(self._gone),
                "episodes_without_an_ego": int(self._state is None),
            },
        )

    def _enter(self) -> str:
        cars = [n for n in self._sumo.vehicle.getIDList() if n in self._number and self._is_car(n)]
        found = places(self._sumo, cars)
        if not found:
            return ""
        rng = stream(self._files.seed, self._files.episode, EGO_ID, "entry")
        place = found[int(rng.integers(max(1, len(found) // 2)))]
        driver = self._files.drivers[place.driver_id]
        (pose,) = poses_of(self._sumo, [place.driver_id], np.array([[driver.length_m, driver.width_m]]))
        # the front bumper stays where it was, so the centre of the ego's body lies a little further back
        back = (LENGTH_M - driver.length_m) / 2
        x, y = pose[0] - back * math.cos(pose[4]), pose[1] - back * math.sin(pose[4])
        take_over(self._sumo, place, VEHICLE)
        self._state = EgoState(float(x), float(y), float(pose[4]), float(place.speed_mps))
        return place.driver_id

    def _is_car(self, name: str) -> bool:
        return bool(self._files.drivers[name].kind == AgentKind.CAR)

    def _frame(self, state: EgoState, walkers: Sequence[Walker], *, time_s: float) -> Frame:
        """Everybody now: SUMO's boxes with the drivers' wander, walkers of stressors, and the ego as it is."""
        walking = [walker for walker in walkers if walker.begin_s - 1e-9 <= time_s <= walker.end_s + 1e-9]
        names = [n for n in self._sumo.vehicle.getIDList() if n in self._number]
        drivers = [self._files.drivers[name] for name in names]
        size = np.array([[driver.length_m, driver.width_m] for driver in drivers]).reshape(-1, 2)
        rows = np.array([self._number[name] for name in names], np.int64)
        pose: Float64[np.ndarray, "vehicle 7"] = poses_of(self._sumo, names, size)
        pose = shifted(pose, *self._wander.advance(rows, np.hypot(pose[:, 2], pose[:, 3])))
        ego = [state.x, state.y, *state.velocity_mps, state.heading_rad]
        crossing = [(*walker.position_m(time_s), *walker.velocity_mps, walker.heading_rad) for walker in walking]
        feet = [(walker.length_m, walker.width_m) for walker in walking]
        kinds = [*(driver.kind for driver in drivers), *(walker.kind for walker in walking)]
        return Frame(
            (EGO_ID, *names, *(walker.name for walker in walking)),
            np.array([AgentKind.CAR, *kinds], np.int8),
            np.vstack([[LENGTH_M, WIDTH_M], size, np.array(feet).reshape(-1, 2)]),
            np.vstack([ego, pose[:, :5], np.array(crossing).reshape(-1, 5)]),
            self._lights(),
        )

    def _lights(self) -> np.ndarray:
        shown = {s: self._sumo.trafficlight.getRedYellowGreenState(s) for s in self._files.signals}
        states = [STATES.get(shown[link.signal][link.index], SignalState.UNKNOWN) for link in self._main]
        return np.array(states, np.int8)

    def _show(self, state: EgoState) -> None:
        """Put the vehicle there in SUMO: front bumper, compass angle."""
        half, heading = LENGTH_M / 2, state.heading_rad
        front_x, front_y = state.x + half * math.cos(heading), state.y + half * math.sin(heading)
        angle = math.degrees(math.pi / 2 - heading) % 360.0
        if VEHICLE not in self._sumo.vehicle.getIDList():
            return  # SUMO has let it arrive at the end of its route; it is logged on until it leaves the road
        self._sumo.vehicle.setSpeed(VEHICLE, state.speed_mps)
        self._sumo.vehicle.moveToXY(VEHICLE, "", -1, front_x, front_y, angle, EXACTLY)
