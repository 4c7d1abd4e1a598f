"""Who waits inside a junction for a gap clears it when its light is red: the others are stopped, or about to start.

SUMO's drivers who wait there to turn left go on yielding to whoever gets green next, and are hit where they stand:
4 collisions in an episode of `yellow_light`'s network with a third of the drivers turning left, none with this.
Who then gets green and stands at the line starts when they are out: SUMO's drivers start at once and creep up to them,
corner to rear (3 collisions in 8 episodes of that network).
"""

from __future__ import annotations

from collections.abc import Collection

from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import Episode

WAITING_MPS = 3.0  # who is faster is under way
RIGHT_OF_WAY = 0b01000  # of SUMO's speed mode
STANDING_MPS, AT_LINE_M = 0.1, 8.0  # who is held at the line: the first of a queue, standing
LONGEST_HOLD_STEPS = 50  # chosen: whoever has not cleared a junction in 5 s cannot, and both would wait for each other
SUMO_DRIVES = -1.0


class JunctionClearing:
    """Call `turned_red` and `turned_green` when lights have turned so, and `before_step` ahead of every step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._drivers = sumo, files.drivers
        self._links, self._length_m = files.network.links, files.network.length_m
        self._junctions: dict[str, set[str]] = {}
        for link in files.network.links:
            if link.edge in files.network.ends:
                self._junctions.setdefault(link.signal, set()).add(f":{files.network.ends[link.edge][1]}")
        self._clearing: dict[str, tuple[str, int]] = {}  # who clears which signal's junction; its own speed mode
        self._held: dict[str, tuple[str, int]] = {}  # who waits at which signal's line; steps left

    def before_step(self) -> None:
        """Who is out of the junction minds the right of way again, and nobody waits for it any more."""
        if not self._clearing and not self._held:
            return
        vehicle = self._sumo.vehicle
        present = set(vehicle.getIDList())
        for name, (_, mode) in list(self._clearing.items()):
            if name in present and vehicle.getRoadID(name).startswith(":"):
                continue
            del self._clearing[name]
            if name in present:
                vehicle.setSpeedMode(name, mode)
        clearing = {signal for signal, _ in self._clearing.values()}
        for name, (signal, steps) in list(self._held.items()):
            if name in present and steps > 0 and signal in clearing:
                self._held[name] = (signal, steps - 1)
                continue
            del self._held[name]
            if name in present:
                vehicle.setSpeed(name, SUMO_DRIVES)

    def turned_red(self, signal: str) -> None:
        """Who waits in the signal's junction goes."""
        vehicle, junctions = self._sumo.vehicle, self._junctions.get(signal, set())
        for name in vehicle.getIDList():
            if name not in self._drivers or name in self._clearing:
                continue
            road = vehicle.getRoadID(name)
            if road.rpartition("_")[0] in junctions and vehicle.getSpeed(name) < WAITING_MPS:
                mode = vehicle.getSpeedMode(name)
                self._clearing[name] = signal, mode
                vehicle.setSpeedMode(name, mode & ~RIGHT_OF_WAY)

    def turned_green(self, signal: str, indices: Collection[int]) -> None:
        """Who stands at the line of one of these links waits for who still clears the signal's junction."""
        if all(signal != other for other, _ in self._clearing.values()):
            return
        vehicle = self._sumo.vehicle
        for lane in sorted({link.lane for link in self._links if link.signal == signal and link.index in indices}):
            for name in self._sumo.lane.getLastStepVehicleIDs(lane):
                to_line_m = self._length_m[lane] - vehicle.getLanePosition(name)
                if name in self._drivers and to_line_m < AT_LINE_M and vehicle.getSpeed(name) < STANDING_MPS:
                    vehicle.setSpeed(name, 0.0)
                    self._held[name] = (signal, LONGEST_HOLD_STEPS)
