"""Drivers in SUMO who choose their speed by the traffic around: see `simulation.flow`."""

from __future__ import annotations

import math

import numpy as np

from stylesim.simulation.flow import ADAPTS_S, flow_speed, wished_speed
from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import DT_S, Episode

EVERY_STEPS = 10  # a second: people look around about that often, and setting a wish every step would cost a quarter


class FlowSense:
    """Call `before_step` ahead of every simulation step; every tenth looks around and sets the wished speeds."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._files = sumo, files
        self._limit = {lane.lane_id: lane.speed_limit_mps for lane in files.network.road.lanes}  # others are asked for
        self._wish: dict[str, float] = {}
        self._keep = math.exp(-EVERY_STEPS * DT_S / ADAPTS_S)

    def before_step(self, step: int) -> None:
        """Looks around and adapts."""
        if step % EVERY_STEPS:
            return
        vehicle, now = self._sumo.vehicle, self._files.now
        names = [name for name in vehicle.getIDList() if name in now]
        if not any(now[name].style.flow_share > 0.0 for name in names):
            return
        heading = np.pi / 2 - np.radians([vehicle.getAngle(name) for name in names])
        lanes = [vehicle.getLaneID(name) for name in names]
        limit = np.array([self._limit_of(lane) for lane in lanes])
        styles = [now[name].style for name in names]
        own = limit * np.array([style.desired_speed_factor for style in styles])
        around = flow_speed(
            np.array([vehicle.getPosition(name) for name in names]),
            np.stack([np.cos(heading), np.sin(heading)], axis=1),
            np.array([vehicle.getSpeed(name) for name in names]),
            own,
        )
        share = np.array([style.flow_share for style in styles])
        wish = wished_speed(own, around, share=share, factor=np.array([style.flow_speed_factor for style in styles]))
        for i in np.flatnonzero(share > 0.0):
            name = names[i]
            before = self._wish.get(name, float(own[i]))
            self._wish[name] = self._keep * before + (1.0 - self._keep) * float(wish[i])
            inside = lanes[i].startswith(":")  # a turn is taken as fast as it allows, however fast the traffic was
            now_mps = min(self._wish[name], float(own[i])) if inside else self._wish[name]
            vehicle.setSpeedFactor(name, now_mps / float(limit[i]))

    def _limit_of(self, lane: str) -> float:
        """Also of lanes that are too short to be in the road."""
        if lane not in self._limit:
            self._limit[lane] = self._sumo.lane.getMaxSpeed(lane)
        return self._limit[lane]
