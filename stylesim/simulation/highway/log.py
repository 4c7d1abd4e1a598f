"""The log of one episode: a row per car and frame in our frame, then `Tracks`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from stylesim.geometry import wrap_angle
from stylesim.plausibility import implausible
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.tracks import AgentKind, TrackFlag, Tracks


class TrackLog:
    """Collects what every car does, frame by frame."""

    def __init__(self, n_frames: int, dt_s: float) -> None:
        self._n_frames, self._dt_s = n_frames, dt_s
        self._frame = 0
        self._rows: list[tuple[int, int, float, float, float, float, float]] = []
        self.vehicles: dict[str, StyledVehicle] = {}
        self._number: dict[str, int] = {}

    def add(self, vehicles: list[StyledVehicle]) -> None:
        """Log the next frame: place, velocity (along the course, body angle plus slip) and body angle."""
        for vehicle in vehicles:
            number = self._number.setdefault(vehicle.driver_id, len(self._number))
            self.vehicles[vehicle.driver_id] = vehicle
            course = vehicle.heading + vehicle.slip_rad
            vx, vy = vehicle.speed * math.cos(course), vehicle.speed * math.sin(course)
            x, y = vehicle.position
            self._rows.append((number, self._frame, x, -y, vx, -vy, -vehicle.heading))
        self._frame += 1

    def tracks(self, removed: set[str], at_lights: Mapping[str, TrackFlag] = MappingProxyType({})) -> Tracks:
        """Everything logged, by id, flagged; a collision's push moves a car in one step, which is implausible."""
        order = sorted(self._number)
        place = {self._number[driver_id]: i for i, driver_id in enumerate(order)}
        state = np.full((len(order), self._n_frames, 5), np.nan)
        for number, frame, *values in self._rows:
            state[place[number], frame] = values
        cars = [self.vehicles[driver_id] for driver_id in order]
        valid = np.isfinite(state[..., 0])
        tracks = Tracks(
            agent_id=tuple(order),
            kind=np.full(len(cars), AgentKind.CAR),
            size_m=np.array([[car.LENGTH, car.WIDTH] for car in cars]).reshape(-1, 2),
            position_m=state[..., 0:2],
            velocity_mps=state[..., 2:4],
            heading_rad=wrap_angle(state[..., 4]),
            valid=valid,
            dt_s=self._dt_s,
            driver=tuple(car.style for car in cars),
            flags=np.array([_flags(car, removed) | int(at_lights.get(car.driver_id, 0)) for car in cars], np.int32),
        )
        assert tracks.flags is not None
        contradicted = np.where(implausible(tracks).agents, np.int32(TrackFlag.IMPLAUSIBLE), np.int32(0))
        return replace(tracks, flags=tracks.flags | contradicted)


def _flags(car: StyledVehicle, removed: set[str]) -> int:
    flags = TrackFlag.COLLIDED if car.crashed else TrackFlag(0)
    flags |= TrackFlag.EMERGENCY_BRAKED if car.emergency_braked else TrackFlag(0)
    flags |= TrackFlag.REMOVED if car.driver_id in removed else TrackFlag(0)
    return int(flags)
