"""Makes stressors happen in highway-env: finds who fits at the moment, does what it takes, says what happened."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from stylesim.road import Road
from stylesim.simulation.crossing import Barrier, barriers, meeting
from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.lanes import lane_id
from stylesim.simulation.highway.spec import LOG_HZ
from stylesim.simulation.highway.traffic import Crew, Traffic
from stylesim.simulation.highway.vehicle import StyledVehicle
from stylesim.simulation.plan import StressorKind
from stylesim.simulation.stressors import Attempt, Event, Outcome
from stylesim.simulation.walkers import Walker
from stylesim.simulation.yielding import SIGHT_M, Yield

SLOWEST_MPS = 5.0  # who is slower is in a queue, where nothing unusual happens
SLOWEST_RUNNER_MPS = 3.0  # who is asked to stop has begun to brake
LEAST_AHEAD_S = 4.0  # to the end of the lane; chosen, so that the event is over before a junction
FOLLOWS_S = (0.5, 3.0)  # time gap of the follower of who brakes hard
RUNS_FROM_M = (5.0, 60.0)  # how far before its line a runner is chosen
RUNS_FOR_S = 10.0  # a junction is left behind by then
STALLS_BEFORE_END_M = 80.0  # of its lane, at least
SLOWER_MPS = 5.0  # who cuts in is at most that much slower than who is cut off
FREE_AHEAD_S = 1.0  # time gap that must be left to who drives ahead in the lane that is cut into

Act = Callable[[float], bool]  # called with the time of every frame; False when it is over


@dataclass
class _Place:
    """A car on a road between junctions; `front_m` along its lane."""

    car: StyledVehicle
    index: LaneIndex
    front_m: float
    left_m: float


@dataclass
class Stressing:
    """The stressors of one episode; call `after_frame` when a frame is logged."""

    traffic: Traffic
    crew: Crew
    road: Road
    waiting: list[Attempt]
    _acts: list[Act] = field(default_factory=list)
    _busy: set[str] = field(default_factory=set)
    _events: list[Event] = field(default_factory=list)
    _walkers: list[Walker] = field(default_factory=list)
    _missed: list[StressorKind] = field(default_factory=list)

    def after_frame(self, now_s: float) -> None:
        """What begins, goes on and ends now."""
        for attempt in [attempt for attempt in self.waiting if now_s >= attempt.at_s - 1e-9]:
            if now_s > attempt.until_s:
                self._missed.append(attempt.kind)
                self.waiting.remove(attempt)
            elif self._begin(attempt, now_s):
                self.waiting.remove(attempt)
        self._acts = [act for act in self._acts if act(now_s)]

    def outcome(self) -> Outcome:
        """What came of it."""
        missed = (*self._missed, *(attempt.kind for attempt in self.waiting))
        return Outcome(tuple(self._events), tuple(self._walkers), missed)

    def _places(self) -> list[_Place]:
        """The cars that the log shows, outside of junctions, by their drivers' ids."""
        road, inside = self.traffic.road, {lane.lane_id for lane in self.road.lanes if lane.in_junction}
        found = []
        for car in sorted(self.traffic.logged(), key=lambda car: car.driver_id):
            index = car.lane_index
            if car.style is None or car.crashed or index != car.target_lane_index or lane_id(index) in inside:
                continue
            if index in road.graph.against:
                continue
            front = road.place(car, index)[0] + car.LENGTH / 2
            found.append(_Place(car, index, front, road.graph.length_m[index] - front))
        return found

    def _begin(self, attempt: Attempt, now_s: float) -> bool:
        slowest = SLOWEST_RUNNER_MPS if attempt.kind == "red_runner" else SLOWEST_MPS
        able = [p for p in self._places() if p.car.driver_id not in self._busy and p.car.speed >= slowest]
        if attempt.kind != "red_runner":
            able = [place for place in able if place.left_m >= LEAST_AHEAD_S * place.car.speed]
        for number in attempt.rng.permutation(len(able)).tolist():
            act = getattr(self, f"_{attempt.kind}")(attempt, able[number], now_s)
            if act is not None:
                self._acts.append(act)
                return True
        return False

    def _note(self, attempt: Attempt, now_s: float, *, actor: str, victim: str) -> None:
        self._busy |= {actor, victim} - {""}
        numbers = {name: value for name, value in attempt.numbers.items() if name != "side"}
        self._events.append(Event(attempt.kind, now_s, actor, victim, numbers))

    def _braking(self, car: StyledVehicle, braking_mps2: float, to_mps: float, hold_s: float) -> Act:
        """Brakes to a speed, holds it, drives on."""
        held: list[float] = []

        def act(now_s: float) -> bool:
            if car.speed <= to_mps + 0.3 and not held:
                held.append(now_s)
            over = car not in self.traffic.road.vehicles or (bool(held) and now_s - held[0] >= hold_s)
            car.event_mps2 = math.inf if over else 0.0 if held and to_mps > 0 else -braking_mps2
            return not over

        act(-math.inf)
        return act

    def _hard_brake(self, attempt: Attempt, place: _Place, now_s: float) -> Act | None:
        behind, gap = self.traffic.road.behind(place.car, place.index)
        if not isinstance(behind, StyledVehicle) or not FOLLOWS_S[0] <= gap / place.car.speed <= FOLLOWS_S[1]:
            return None
        self._note(attempt, now_s, actor=place.car.driver_id, victim=behind.driver_id)
        numbers = attempt.numbers
        to_mps = place.car.speed * numbers["to_share"]
        return self._braking(place.car, numbers["braking_mps2"], to_mps, numbers["hold_s"])

    def _stalled(self, attempt: Attempt, place: _Place, now_s: float) -> Act | None:
        braking = attempt.numbers["braking_mps2"]
        if place.left_m < place.car.speed**2 / (2 * braking) + STALLS_BEFORE_END_M:
            return None
        behind, _ = self.traffic.road.behind(place.car, place.index)
        victim = behind.driver_id if isinstance(behind, StyledVehicle) else ""
        self._note(attempt, now_s, actor=place.car.driver_id, victim=victim)
        return self._braking(place.car, braking, 0.0, attempt.numbers["hold_s"])

    def _cut_in(self, attempt: Attempt, place: _Place, now_s: float) -> Act | None:
        car, road, gap_s = place.car, self.traffic.road, attempt.numbers["gap_s"]
        for index in road.network.side_lanes(place.index):
            if index in road.graph.against:
                continue
            (rear, back), (front, ahead) = road.behind(car, index), road.ahead(car, index)
            if not isinstance(rear, StyledVehicle) or rear.driver_id in self._busy:
                continue
            fits = 0.5 * gap_s <= back / max(rear.speed, 1.0) <= gap_s and rear.speed - car.speed <= SLOWER_MPS
            if fits and (front is None or ahead > FREE_AHEAD_S * car.speed):
                self._note(attempt, now_s, actor=car.driver_id, victim=rear.driver_id)
                car.cut_in(index, attempt.numbers["duration_s"])
                return self._change_back(car, now_s + attempt.numbers["duration_s"] + 1.0)
        return None

    def _change_back(self, car: StyledVehicle, until_s: float) -> Act:
        def act(now_s: float) -> bool:
            car.enable_lane_change = now_s >= until_s
            return now_s < until_s

        return act

    def _red_runner(self, attempt: Attempt, place: _Place, now_s: float) -> Act | None:
        car = place.car
        asked = car.waits_for_gap or bool(getattr(car, "is_yielding", False)) or car.stop_mps2 < math.inf
        has_line = self.road.lane(lane_id(place.index)).stop_line_m is not None
        if not asked or not has_line or not RUNS_FROM_M[0] <= place.left_m <= RUNS_FROM_M[1]:
            return None
        self._note(attempt, now_s, actor=car.driver_id, victim="")
        car.runs = True

        def act(later_s: float) -> bool:
            car.runs = later_s < now_s + RUNS_FOR_S
            return car.runs

        return act

    def _jaywalker(self, attempt: Attempt, place: _Place, now_s: float) -> Act | None:
        car, name = place.car, f"{attempt.kind}-0"
        met = meeting(
            attempt,
            self.road,
            lane_id(place.index),
            from_m=place.front_m,
            speed_mps=car.speed,
            now_s=now_s,
            name=name,
        )
        if met is None:
            return None
        self._note(attempt, now_s, actor=name, victim=car.driver_id)
        self._walkers.append(met.walker)
        planned = barriers(met)
        yields: dict[str, tuple[StyledVehicle, Yield]] = {}

        def act(later_s: float) -> bool:
            for barrier in planned:
                self._give_way(barrier, later_s, yields, name)
            return any(later_s < barrier.until_s for barrier in planned)

        return act

    _deer = _jaywalker

    def _give_way(
        self, barrier: Barrier, now_s: float, yields: dict[str, tuple[StyledVehicle, Yield]], walker: str
    ) -> None:
        """The nearest driver before the walker's way brakes for it, by its style; who was it before drives on."""
        active = barrier.from_s <= now_s < barrier.until_s
        car = self._next_car(barrier) if active else None
        before = yields.get(barrier.lane_id)
        if before is not None and before[0] is not car:
            before[0].event_mps2 = math.inf
            del yields[barrier.lane_id]
        if car is None or car.style is None:
            return
        if barrier.lane_id not in yields:
            rng = self.crew.driver_stream(car.driver_id, f"response {walker}")
            yields[barrier.lane_id] = car, Yield.begin(car.driver_id, car.style, now_s, rng)
        gap = barrier.along_m - self.traffic.road.place(car, car.lane_index)[0] - car.LENGTH / 2
        law = yields[barrier.lane_id][1]
        wanted = law.deceleration(now_s, speed_mps=car.speed, gap_m=gap, dt_s=1.0 / LOG_HZ)
        car.event_mps2 = math.inf if wanted is None else -wanted

    def _next_car(self, barrier: Barrier) -> StyledVehicle | None:
        found: list[tuple[float, str, StyledVehicle]] = []
        for car in self.traffic.road.vehicles:
            if lane_id(car.lane_index) == barrier.lane_id and isinstance(car, StyledVehicle):
                front = self.traffic.road.place(car, car.lane_index)[0] + car.LENGTH / 2
                if barrier.along_m - SIGHT_M < front < barrier.along_m:
                    found.append((front, car.driver_id, car))
        return max(found)[2] if found else None
