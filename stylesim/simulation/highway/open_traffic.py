"""Traffic that comes and goes: newcomers enter where trips begin, cars leave where they end."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from stylesim.signals import Signals
from stylesim.simulation.highway.demand import LEAD_S, SHORTEST_HEADWAY_S, Way, arrivals, dilemmas, draw_way
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.lane_choice import lane_needs, must_change
from stylesim.simulation.highway.lanes import lane_id
from stylesim.simulation.highway.lights import Lights
from stylesim.simulation.highway.road import StyledRoad
from stylesim.simulation.highway.sites import Edge, Site
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.traffic import Crew, Traffic, fastest_first
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.tracks import TrackFlag

SETTLING_S = 3.0  # after insertion, not logged: cars find their speed and gap in that time (as in the other simulator)
ENTRY_HEADWAY_S = 1.5  # who wants more than that behind its leader opens the gap after it has entered
ENTRY_FASTER_MPS = 3.0  # at most that much faster than the leader at the entry
LOOK_EVERY_S = 0.2  # how often drivers look for a gap; chosen: a glance
LEAVES_M = 8.0  # before the end of its last lane a car has arrived
MISSED_M = 5.0  # who is that close to the fork and not in its lane goes on where its lane leads


class OpenTraffic(Traffic):
    """A site with traffic through it, filled at the start so that no warm-up of a whole trip is needed."""

    def __init__(self, site: Site, options: HighwayOptions, crew: Crew, *, time_s: float) -> None:
        road = StyledRoad(network=site.network, np_random=crew.stream("road"))
        road.graph.against = site.against
        super().__init__(road, crew, options)
        self.junction_nodes = site.junction_nodes
        self._site = site
        self._ways = tuple(Way(trip, lane_needs(road.graph, trip.edges)) for trip in site.trips)
        self._step = 0
        self._entered: dict[str, int] = {}  # driver -> step of its insertion; who stood there at the start is not in it
        self._waiting: dict[Edge, deque[StyledVehicle]] = {edge: deque() for edge in site.arrivals_per_s}
        self.lights = self._lights()
        self._rule = site.rule(road.graph) if site.rule is not None else None
        self._due: list[tuple[float, Edge, int]] = []
        self._placed: list[tuple[float, LaneIndex, float]] = []
        if self.lights is not None and options.arrivals == "dilemma":
            self._placed = dilemmas(self.lights, rng=crew.stream("demand"), until_s=time_s - site.last_entry_s)
        else:
            self._due = arrivals(
                site.arrivals_per_s,
                self._ways,
                road.graph.beside,
                rng=crew.stream("demand"),
                until_s=time_s - site.last_entry_s,
            )
            self._fill(crew.stream("placement"))

    def _lights(self) -> Lights | None:
        if self._site.light is None:
            return None
        lanes = [index for index in self.road.graph.after if self._enters_junction(index)]
        offset = float(self._crew.stream("signal").uniform(0.0, self._site.light.cycle_s))
        return Lights(lanes, replace(self._site.light, offset_s=offset), self._crew.driver_stream, dt_s=self._dt)

    def _enters_junction(self, index: LaneIndex) -> bool:
        inner = self.junction_nodes
        return index[1].startswith(inner) and not index[0].startswith(inner)

    def _fill(self, rng: np.random.Generator) -> None:
        """Cars at the spacing of the arrivals along the first part of each way in, faster ones farther left."""
        for edge, far in sorted(self._site.filled_m.items()):
            lanes = self.road.graph.beside[edge]
            rate = self._site.arrivals_per_s[edge] / lanes
            if rate <= 0:
                continue
            limit = float(self.road.network.get_lane((*edge, 0)).speed_limit)
            spacing = limit / rate
            place = [10.0 + spacing * rng.uniform(0.0, 1.0) for _ in range(lanes)]
            while min(place) < far:
                beside = [self._stand((*edge, 0), draw_way(self._ways, edge, rng)) for lane in range(lanes)]
                for lane, vehicle in enumerate(fastest_first(beside)):
                    self._set(vehicle, (*edge, lane), place[lane])
                    place[lane] += max(spacing * rng.uniform(0.5, 1.5), SHORTEST_HEADWAY_S * limit)

    def _stand(self, index: LaneIndex, way: int) -> StyledVehicle:
        vehicle = StyledVehicle.make_on_lane(self.road, index, 0.0, 0.0)
        self._brief(vehicle, way)
        self._hire(vehicle)
        return vehicle

    def _set(self, vehicle: StyledVehicle, index: LaneIndex, place_m: float) -> None:
        """Put a car at a place along its way, which may lie beyond its first road."""
        while place_m > self.road.graph.length_m[index]:
            onward = self.road.graph.onward(index, vehicle.route)
            if onward is None:
                return
            place_m, index = place_m - self.road.graph.length_m[index], onward
        lane = self.road.network.get_lane(index)
        self._put(vehicle, index, place_m, 0.9 * min(vehicle.wished_speed_mps, 1.2 * lane.speed_limit))
        del self._entered[vehicle.driver_id]

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
            self.lights.not_executed = self.lights.gave_up = 0

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
        if self._rule is not None and self._step % round(LOOK_EVERY_S / self._dt) == 0:
            self._rule.assign(self.road.vehicles)
        super().advance()
        self._step += 1
        self._leave()
        while self._placed and self._placed[-1][0] <= self._step * self._dt:
            self._place(*self._placed.pop()[1:])
        while self._due and self._due[-1][0] <= self._step * self._dt:
            _, edge, way = self._due.pop()
            self._waiting[edge].append(self._stand((*edge, 0), way))
        for edge, queue in self._waiting.items():
            while queue and self._enters(edge, queue[0]):
                queue.popleft()
        if self.lights is not None:
            self.counts["stops_not_executed"] = self.lights.not_executed
            self.counts["gave_up_at_red"] = self.lights.gave_up
        self.counts["not_inserted"] = sum(len(queue) for queue in self._waiting.values())

    def _place(self, index: LaneIndex, time_to_line_s: float) -> None:
        """One car that will be that far from the line at the coming onset of yellow, at the speed it wishes."""
        vehicle = self._stand(index, draw_way(self._ways, index[:2], self._crew.stream("ways")))
        distance = vehicle.wished_speed_mps * (time_to_line_s + LEAD_S) + vehicle.LENGTH / 2
        self._put(vehicle, index, self.road.graph.length_m[index] - distance, vehicle.wished_speed_mps)

    def _put(self, vehicle: StyledVehicle, index: LaneIndex, along_m: float, speed_mps: float) -> None:
        vehicle.stand_at(index, along_m)
        vehicle.speed = speed_mps
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
        for lane in reversed(range(self.road.graph.beside[edge])):  # the rightmost of those that are as good
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
