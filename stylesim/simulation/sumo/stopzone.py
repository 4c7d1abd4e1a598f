"""The solid line before a signal: close to the stop line nobody changes lanes for speed.

Without it queueing drivers stop half-way between lanes, which SUMO does not see as two lanes taken: 9 overlaps of
logged boxes in 8 episodes of `yellow_light`, none with discretionary changes off (seed 3, tdbm_spectrum).
Changes that the route needs stay allowed.
"""

from __future__ import annotations

from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import Episode

SOLID_LINE_M = 80.0  # chosen, because queues of the shipped scenarios are mostly shorter
EVERY_STEPS = 5  # a car moves 10 m at most in that time
FREE = 0b011001010101  # SUMO's default: every reason to change
NEEDED_ONLY = 0b011000000101  # without gain of speed and without keeping right


class StopZone:
    """Call `before_step` ahead of every simulation step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo = sumo
        self._length_m = {lane: files.network.length_m[lane] for lane in files.network.controlled_lanes()}
        self._drivers = files.drivers
        self._held: set[str] = set()

    def before_step(self, step: int) -> None:
        """Every fifth step: holds who came close, frees who has left."""
        if not self._length_m or step % EVERY_STEPS:
            return
        vehicle = self._sumo.vehicle
        close = set()
        for lane, length in self._length_m.items():
            for name in self._sumo.lane.getLastStepVehicleIDs(lane):
                if name in self._held or length - vehicle.getLanePosition(name) < SOLID_LINE_M:
                    close.add(name)
        for name in close - self._held:
            if name in self._drivers:
                vehicle.setLaneChangeMode(name, NEEDED_ONLY)
        left = self._held - close
        if left:
            for name in left & set(vehicle.getIDList()) & set(self._drivers):
                vehicle.setLaneChangeMode(name, FREE)
        self._held = close
