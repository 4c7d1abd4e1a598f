"""Traffic that comes and goes: newcomers enter where trips begin, cars leave where they end."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stylesim.signals import Signals
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.lane_choice import lane_needs, must_change
from stylesim.simulation.highway.lanes import lane_id
from stylesim.simulation.highway.lights import Lights
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.sites import Edge, Site, Trip
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.traffic import Crew, Traffic
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.tracks import TrackFlag

SETTLING_S = 3.0  # after insertion, not logged: cars find their speed and gap in that time (as in the other simulator)
LAST_ENTRY_S = 27.0  # nobody enters later than that before the end, so that everybody is seen for 20 s and more
SHORTEST_HEADWAY_S = 1.0  # between two arrivals in one lane; chosen: bold drivers follow so closely
ENTRY_HEADWAY_S = 1.5  # who wants more than that behind its leader opens the gap after it has entered
ENTRY_FASTER_MPS = 3.0  # at most that much faster than the leader at the entry
LEAD_S = 4.0  # single cars are placed that long before the onset of yellow, so that they are logged for 1 s before it
DILEMMA_S = (1.0, 6.0)  # REFERENCE section 5: who is nearer goes, who is farther stops
LEAVES_M = 8.0  # before the end of its last lane a car has arrived
MISSED_M = 5.0  # who is that close to the fork and not in its lane goes on where its lane leads


@dataclass(frozen=True, eq=False)
class _Way:
    """A trip, with the lane changes that it asks for."""

    trip: Trip
    needs: Any

    def route(self) -> list[Any]:
        return [(*edge, None) for edge in self.trip.edges]


class OpenTraffic(Traffic):
    """A site with traffic through it, filled at the start so that no warm-up of a whole trip is needed."""

    def __init__(self, site: Site, options: HighwayOptions, crew: Crew, *, time_s: float) -> None:
        road = StyledRoad(network=site.network, np_random=crew.stream("road"))
        super().__init__(road, crew, options)
        self.junction_nodes = site.junction_nodes
        self._site = site
        self._ways = tuple(_Way(trip, lane_needs(road.graph, trip.edges)) for trip in site.trips)
        self._step = 0
        self._entered: dict[str, int] = {}  # driver -> step of its insertion; who stood there at the start is not in it
        self._waiting: dict[Edge, deque[StyledVehicle]] = {edge: deque() for edge in site.arrivals_per_s}
        self.lights = self._lights()
        self._due: list[tuple[float, Edge, int]] = []
        self._placed: list[tuple[float, LaneIndex, float]] = []
        if self.lights is not None and options.arrivals == "dilemma":
            self._placed = self._dilemmas(crew.stream("demand"), self.lights, time_s - LAST_ENTRY_S)
        else:
            self._due = self._arrivals(crew.stream("demand"), time_s - LAST_ENTRY_S)
            self._fill(crew.stream("placement"))

    def _lights(self) -> Lights | None:
        if self._site.light is None:
            return None
        lanes = [index for index in self.road.graph.after if self._enters_junction(index)]
        offset = float(self._crew.stream("signal").uniform(0.0, self._site.light.cycle_s))
        return Lights(lanes, replace(self._site.light, offset_s=offset), key=self._crew.key)

    def _enters_junction(self, index: LaneIndex) -> bool:
        inner = self.junction_nodes
        return index[1].startswith(inner) and not index[0].startswith(inner)

    def _dilemmas(self, rng: np.random.Generator, lights: Lights, until_s: float) -> list[tuple[float, LaneIndex, float]]:
        """(time of insertion, lane, time to the line at the onset of yellow) of single cars, latest first."""
        onsets = [onset - LEAD_S for onset in lights.programme.onsets_of_yellow(until_s) if onset >= LEAD_S]
        placed = [(time, index, float(rng.uniform(*DILEMMA_S))) for time in onsets for index in lights.lanes]
        return sorted(placed, reverse=True)

    def _arrivals(self, rng: np.random.Generator, until_s: float) -> list[tuple[float, Edge, int]]:
        """(time, entry, way) of every arrival, latest first: random headways with a shortest one."""
        due = []
        for edge, rate in sorted(self._site.arrivals_per_s.items()):
            if rate <= 0:
                continue
            lanes = self.road.graph.beside[edge]
            least = min(SHORTEST_HEADWAY_S / lanes, 0.8 / rate)
            time = 0.0
            while True:
                time += least + rng.exponential(1.0 / rate - least)
                if time > until_s:
                    break
                due.append((time, edge, self._draw_way(edge, rng)))
        return sorted(due, reverse=True)

    def _draw_way(self, edge: Edge, rng: np.random.Generator) -> int:
        fitting = [number for number, way in enumerate(self._ways) if way.trip.edges[0] == edge]
        shares = np.array([self._ways[number].trip.share for number in fitting])
        return int(fitting[int(rng.choice(len(fitting), p=shares / shares.sum()))])

    def _fill(self, rng: np.random.Generator) -> None:
        """Cars at the spacing of the arrivals along the first part of each way in."""
        for edge, far in sorted(self._site.filled_m.items()):
            lanes = self.road.graph.beside[edge]
            rate = self._site.arrivals_per_s[edge] / lanes
            if rate <= 0:
                continue
            limit = float(self.road.network.get_lane((*edge, 0)).speed_limit)
            spacing = limit / rate
            for lane in range(lanes):
                place = 10.0 + spacing * rng.uniform(0.0, 1.0)
                while place < far:
                    self._stand(edge, lane, place, self._draw_way(edge, rng))
                    place += max(spacing * rng.uniform(0.5, 1.5), SHORTEST_HEADWAY_S * limit)

    def _stand(self, edge: Edge, lane: int, place_m: float, way: int) -> None:
        """One car at a place along its way, which may lie beyond its first road."""
        edges = self._ways[way].trip.edges
        index = (*edge, lane)
        for following in edges[1:]:
            length = self.road.graph.length_m[index]
            if place_m <= length:
                break
            onward = [other for other in self.road.graph.after[index] if other[:2] == following]
            if not onward:
                return
            place_m, index = place_m - length, onward[0]
        vehicle = StyledVehicle.make_on_lane(self.road, index, place_m, 0.0)
        self._brief(vehicle, way)
        self._hire(vehicle)
        vehicle.speed = 0.9 * vehicle.wished_speed_mps
        self.road.vehicles.append(vehicle)

    def _brief(self, vehicle: StyledVehicle, way: int) -> None:
        vehicle.route, vehicle.needs = self._ways[way].route(), self._ways[way].needs

    def logged(self) -> list[StyledVehicle]:
        """Everybody but those who entered within the last seconds."""
        settling = round(SETTLING_S / self._dt)
        return [v for v in self.road.vehicles if self._step - self._entered.get(v.driver_id, -settling) >= settling]

    def start_log(self) -> None:
        """From now on what happens counts."""
        super().start_log()
        if self.lights is not None:
            self.lights.flags.clear()

    def frame(self) -> list[StyledVehicle]:
        """The cars of the next logged frame, and the lights."""
        if self.lights is not None:
            self.lights.note_frame(self._step * self._dt)
        return super().frame()

    def flags(self) -> Mapping[str, TrackFlag]:
        """What happened at the lights."""
        return {} if self.lights is None else self.lights.flags

    def signals(self) -> Signals | None:
        """What the lights showed, one for each lane."""
        return None if self.lights is None else self.lights.signals(map(lane_id, self.lights.lanes))

    def advance(self) -> None:
        """One simulation step, then cars leave and enter."""
        if self.lights is not None:
            self.lights.before_step(self._step * self._dt, self.road)
        super().advance()
        self._step += 1
        self._leave()
        while self._placed and self._placed[-1][0] <= self._step * self._dt:
            self._place(*self._placed.pop()[1:])
        while self._due and self._due[-1][0] <= self._step * self._dt:
            _, edge, way = self._due.pop()
            vehicle = StyledVehicle.make_on_lane(self.road, (*edge, 0), StyledVehicle.LENGTH, 0.0)
            self._brief(vehicle, way)
            self._hire(vehicle)
            self._waiting[edge].append(vehicle)
        for edge, queue in self._waiting.items():
            while queue and self._enters(edge, queue[0]):
                queue.popleft()
        self.counts["not_inserted"] = sum(len(queue) for queue in self._waiting.values())

    def _place(self, index: LaneIndex, time_to_line_s: float) -> None:
        """One car that will be that far from the line at the coming onset of yellow, at the speed it wishes."""
        vehicle = StyledVehicle.make_on_lane(self.road, index, StyledVehicle.LENGTH, 0.0)
        self._brief(vehicle, self._draw_way(index[:2], self._crew.stream("ways")))
        self._hire(vehicle)
        distance = vehicle.wished_speed_mps * (time_to_line_s + LEAD_S) + vehicle.LENGTH / 2
        self._put(vehicle, index, self.road.graph.length_m[index] - distance, vehicle.wished_speed_mps)

    def _put(self, vehicle: StyledVehicle, index: LaneIndex, along_m: float, speed_mps: float) -> None:
        lane = self.road.network.get_lane(index)
        vehicle.position = np.array(lane.position(along_m, 0.0), np.float64)
        vehicle.heading, vehicle.speed = float(lane.heading_at(along_m)), speed_mps
        vehicle.lane_index, vehicle.lane = index, lane
        vehicle.aim_at(index)
        self.road.vehicles.append(vehicle)
        self._entered[vehicle.driver_id] = self._step

    def _hire(self, vehicle: StyledVehicle) -> None:
        """A driver for the car; what it wishes belongs to the fastest road of its way."""
        limits = [self.road.network.get_lane((*leg[:2], 0)).speed_limit for leg in vehicle.route]
        self._crew.hire(vehicle, limit_mps=float(max(limits)))

    def _leave(self) -> None:
        staying = []
        for vehicle in self.road.vehicles:
            index = vehicle.target_lane_index
            edge = index[:2]
            if not vehicle.crashed:
                left = self.road.graph.length_m[index] - self.road.place(vehicle, index)[0]
                if left < LEAVES_M and not (vehicle.route and edge != self._last_edge(vehicle)):
                    continue
                self._miss(vehicle)
            staying.append(vehicle)
        if len(staying) < len(self.road.vehicles):
            self.road.vehicles = staying

    @staticmethod
    def _last_edge(vehicle: StyledVehicle) -> Edge:
        last: Edge = vehicle.route[-1][:2]
        return last

    def _miss(self, vehicle: StyledVehicle) -> None:
        """Who cannot reach its lane any more takes another way that its own lane leads to."""
        changes, left = must_change(vehicle)
        if not changes or left > MISSED_M:
            return
        index = vehicle.target_lane_index
        for way in self._ways:
            if index in way.needs and way.needs[index][0] == 0 and index[:2] in way.trip.edges:
                place = way.trip.edges.index(index[:2])
                vehicle.route, vehicle.needs = way.route()[place:], way.needs
                self.counts["missed_its_way"] += 1
                return

    def _enters(self, edge: Edge, vehicle: StyledVehicle) -> bool:
        """Put the car on the lane of its entry where it can drive fastest, if there is room on one."""
        assert vehicle.style is not None
        wish, style = vehicle.wished_speed_mps, vehicle.style
        best, fastest = None, 0.0
        for lane in range(self.road.graph.beside[edge]):
            index = (*edge, lane)
            start = self.road.network.get_lane(index)
            vehicle.position = np.array(start.position(vehicle.LENGTH, 0.0))
            leader, gap = self.road.first_on(index)
            speed = wish if leader is None else min(wish, leader.speed + ENTRY_FASTER_MPS)
            headway = min(style.time_headway_s, ENTRY_HEADWAY_S)
            if leader is not None and gap - 1.5 * vehicle.LENGTH < style.min_gap_m + headway * speed:
                continue
            if speed > fastest:
                best, fastest = index, speed
        if best is None:
            return False
        self._put(vehicle, best, vehicle.LENGTH, fastest)
        return True
