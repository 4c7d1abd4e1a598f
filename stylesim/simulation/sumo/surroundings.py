"""Who is where on SUMO's roads at the moment, and who is near whom."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stylesim.simulation.sumo.episode import EpisodeFiles

SETTLED_S = 5.0  # on the road; earlier nobody is chosen for anything (the log begins 3 s after the insertion)
FREE_AHEAD_S = 1.0  # time gap that must be left to who drives ahead in the lane that is cut into
FREE_AHEAD_M = 15.0
SLOWER_MPS = 5.0  # who cuts in is at most that much slower than who is cut off; chosen, else nobody could answer
LOOK_BACK_M = 100.0


@dataclass(frozen=True)
class Here:
    """A driver on a road between junctions; `position_m` is of its front bumper."""

    driver: str
    lane: str
    position_m: float
    speed_mps: float
    length_m: float  # of the lane

    @property
    def left_m(self) -> float:
        """To the end of the lane."""
        return self.length_m - self.position_m


def drivers_here(sumo: Any, files: EpisodeFiles) -> list[Here]:
    """The drivers who are settled and outside of junctions, by their names."""
    vehicle, now = sumo.vehicle, sumo.simulation.getTime()
    found = []
    for name in sorted(vehicle.getIDList()):
        lane = vehicle.getLaneID(name)
        if name not in files.drivers or not lane or lane.startswith(":"):
            continue
        if now - vehicle.getDeparture(name) < SETTLED_S:
            continue
        length = files.network.length_m[lane]
        found.append(Here(name, lane, vehicle.getLanePosition(name), vehicle.getSpeed(name), length))
    return found


def follower(sumo: Any, here: Here) -> tuple[str, float] | None:
    """(who is next behind on the lane, gap in m), within 100 m."""
    name, gap = sumo.vehicle.getFollower(here.driver, LOOK_BACK_M)
    return (name, gap + sumo.vehicle.getMinGap(name)) if name else None


def leader_within(sumo: Any, here: Here, distance_m: float) -> bool:
    """True if somebody drives, or stands, ahead within that distance."""
    found = sumo.vehicle.getLeader(here.driver, distance_m)
    return bool(found) and bool(found[0]) and found[1] < distance_m


@dataclass(frozen=True)
class Room:
    """A place on the lane beside, just ahead of somebody."""

    lane_index: int
    victim: str


def room_beside(sumo: Any, here: Here, gap_s: float) -> Room | None:
    """Where the driver can cut in, leaving at most `gap_s` (and at least half of it) to who comes behind."""
    vehicle = sumo.vehicle
    edge, index = here.lane.rsplit("_", 1)
    back = here.position_m - vehicle.getLength(here.driver)
    for other in (int(index) + 1, int(index) - 1):
        if not 0 <= other < sumo.edge.getLaneNumber(edge):
            continue
        places = {name: vehicle.getLanePosition(name) for name in sumo.lane.getLastStepVehicleIDs(f"{edge}_{other}")}
        behind = [(place, name) for name, place in places.items() if place < back]
        if not behind or any(back <= place <= here.position_m + FREE_AHEAD_M for place in places.values()):
            continue
        place, name = max(behind)
        speed = max(vehicle.getSpeed(name), 1.0)
        if speed - here.speed_mps > SLOWER_MPS:
            continue
        ahead = [p - vehicle.getLength(n) - here.position_m for n, p in places.items() if p > here.position_m]
        if 0.5 * gap_s <= (back - place) / speed <= gap_s and min(ahead, default=1e9) > FREE_AHEAD_S * here.speed_mps:
            return Room(other, name)
    return None


def red_light_ahead_m(sumo: Any, here: Here) -> float | None:
    """To the stop line where the light, or where there is none the right of way, asks the driver to stop; else None."""
    lights = sumo.vehicle.getNextTLS(here.driver)
    if lights:
        signal, _, distance, state = lights[0]
        arrives_s = sumo.simulation.getTime() + distance / max(here.speed_mps, 1.0)
        red = state in "rR" and sumo.trafficlight.getNextSwitch(signal) > arrives_s
        return float(distance) if red and distance <= here.left_m + 1.0 else None
    for link in sumo.vehicle.getNextLinks(here.driver)[:1]:
        state = link[6] if len(link) > 6 else ""
        if state in ("m", "s", "w"):  # minor, stop sign, all-way stop
            return here.left_m
    return None
