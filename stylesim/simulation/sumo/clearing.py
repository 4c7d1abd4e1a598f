"""Who waits inside a junction for a gap clears it when its light is red: the others are stopped, or about to start.

SUMO's drivers who wait there to turn left go on yielding to whoever gets green next, and are hit where they stand:
4 collisions in an episode of `yellow_light`'s network with a third of the drivers turning left, none with this.
"""

from __future__ import annotations

from stylesim.simulation.sumo.engine import SumoApi
from stylesim.simulation.sumo.episode import Episode

WAITING_MPS = 3.0  # who is faster is under way
RIGHT_OF_WAY = 0b01000  # of SUMO's speed mode


class JunctionClearing:
    """Call `turned_red` when a light of a signal has turned red, and `before_step` ahead of every step."""

    def __init__(self, sumo: SumoApi, files: Episode) -> None:
        self._sumo, self._drivers = sumo, files.drivers
        self._junctions: dict[str, set[str]] = {}
        for link in files.network.links:
            if link.edge in files.network.ends:
                self._junctions.setdefault(link.signal, set()).add(f":{files.network.ends[link.edge][1]}")
        self._modes: dict[str, int] = {}

    def before_step(self) -> None:
        """Who is out of the junction minds the right of way again."""
        if not self._modes:
            return
        vehicle = self._sumo.vehicle
        present = set(vehicle.getIDList())
        for name, mode in list(self._modes.items()):
            if name in present and vehicle.getRoadID(name).startswith(":"):
                continue
            del self._modes[name]
            if name in present:
                vehicle.setSpeedMode(name, mode)

    def turned_red(self, signal: str) -> None:
        """Who waits in the signal's junction goes."""
        vehicle, junctions = self._sumo.vehicle, self._junctions.get(signal, set())
        for name in vehicle.getIDList():
            if name not in self._drivers or name in self._modes:
                continue
            road = vehicle.getRoadID(name)
            if road.rpartition("_")[0] in junctions and vehicle.getSpeed(name) < WAITING_MPS:
                self._modes[name] = vehicle.getSpeedMode(name)
                vehicle.setSpeedMode(name, self._modes[name] & ~RIGHT_OF_WAY)
