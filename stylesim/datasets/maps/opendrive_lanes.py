"""Roads, lane sections and lanes of an OpenDRIVE document, and where each lane leads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from stylesim.datasets.maps.opendrive_curves import Cubics, Plan
from stylesim.datasets.maps.units import MPS_PER_KMH, MPS_PER_MPH

# Lane types for motor traffic [read: the lane types of OpenDRIVE 1.4 to 1.8].
DRIVABLE = frozenset(
    {
        "driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional", "bus", "taxi",
        "HOV", "mwyEntry", "mwyExit", "special1", "roadWorks",
    }
)  # fmt: skip
_SPEED_UNITS = {"": 1.0, "m/s": 1.0, "km/h": MPS_PER_KMH, "mph": MPS_PER_MPH}
MAX_ROAD_M = 100_000.0  # chosen: longer is no road of a site


@dataclass(frozen=True, eq=False)
class RoadLane:
    """One lane of a section; number < 0 is right of the reference line."""

    number: int
    kind: str
    width: Cubics
    is_border: bool  # `width` holds the outer border's t instead
    predecessor: int | None
    successor: int | None
    limit_mps: float


@dataclass(frozen=True, eq=False)
class Section:
    """The lanes between two stations of a road."""

    start: float
    end: float
    lanes: Mapping[int, RoadLane]


@dataclass(frozen=True, eq=False)
class XRoad:
    """One road."""

    road_id: str
    junction: str  # "" outside of junctions
    forward_right: bool  # right-hand traffic: lanes right of the line drive along it
    plan: Plan
    offset: Cubics
    sections: tuple[Section, ...]
    links: Mapping[str, tuple[str, str, str]] = field(default_factory=dict)  # "successor" -> (kind, id, contact)

    def forward(self, lane: int) -> bool:
        """True for a lane that is driven along the reference line."""
        return (lane < 0) == self.forward_right


def road_of(element: Element) -> XRoad:
    """A road element. ValueError, naming the road, where its numbers make no road."""
    road_id = element.get("id", "")
    try:
        length = float(element.get("length", "nan"))
        if not 0 < length <= MAX_ROAD_M:
            raise ValueError(f"its length is {element.get('length')!r}")
        junction = element.get("junction", "-1")
        return XRoad(
            road_id=road_id,
            junction="" if junction == "-1" else junction,
            forward_right=element.get("rule", "RHT") != "LHT",
            plan=Plan.of(element),
            offset=Cubics.of(element.findall("lanes/laneOffset"), "s"),
            sections=tuple(_sections(element, length)),
            links={
                name: (link.get("elementType", ""), link.get("elementId", ""), link.get("contactPoint", ""))
                for name in ("predecessor", "successor")
                if (link := element.find(f"link/{name}")) is not None
            },
        )
    except ValueError as error:
        raise ValueError(f"road {road_id!r}: {error}") from error


def _sections(road: Element, length: float) -> Iterator[Section]:
    elements = road.findall("lanes/laneSection")
    starts = [float(e.get("s", "nan")) for e in elements]
    if not all(math.isfinite(s) for s in starts) or starts != sorted(starts):
        raise ValueError("its lane sections are not in order")
    for element, start, end in zip(elements, starts, [*starts[1:], length], strict=True):
        limit = _road_limit(road, start)
        lanes = [
            _lane(lane, limit)
            for side in ("left", "right")
            for lane in element.findall(f"{side}/lane")
            if lane.get("id", "0") != "0"
        ]
        yield Section(start, max(end, start), {lane.number: lane for lane in lanes})


def _lane(element: Element, limit_mps: float) -> RoadLane:
    widths, borders = element.findall("width"), element.findall("border")
    speed = element.find("speed")
    own = math.nan if speed is None else _speed(speed)
    return RoadLane(
        number=int(element.get("id", "")),
        kind=element.get("type", ""),
        width=Cubics.of(widths or borders, "sOffset"),
        is_border=not widths and bool(borders),
        predecessor=_link(element, "predecessor"),
        successor=_link(element, "successor"),
        limit_mps=limit_mps if math.isnan(own) else own,
    )


def _link(element: Element, name: str) -> int | None:
    link = element.find(f"link/{name}")
    return None if link is None else int(link.get("id", ""))


def _road_limit(road: Element, s: float) -> float:
    """The limit of the last <type> that begins at or before a station; NaN where none says it."""
    types = sorted((float(t.get("s", "nan")), i, t) for i, t in enumerate(road.findall("type")))
    before = [t for start, _, t in types if start <= s + 1e-6]
    speed = before[-1].find("speed") if before else None
    return math.nan if speed is None else _speed(speed)


def _speed(element: Element) -> float:
    try:
        value = float(element.get("max", "")) * _SPEED_UNITS[element.get("unit", "")]
    except (ValueError, KeyError):  # "no limit", "undefined", a unit of no speed
        return math.nan
    return value if 0 < value < 100 else math.nan


class Network:
    """All roads and junctions: where a lane leads."""

    def __init__(self, roads: Mapping[str, XRoad], document: Element) -> None:
        self.roads = roads
        self._connections: dict[tuple[str, str], list[tuple[str, str, dict[int, int]]]] = {}
        for junction in document.findall("junction"):
            for one in junction.findall("connection"):
                lanes = {int(link.get("from", "")): int(link.get("to", "")) for link in one.findall("laneLink")}
                key = (junction.get("id", ""), one.get("incomingRoad", ""))
                target = (one.get("connectingRoad", ""), one.get("contactPoint", "start"), lanes)
                self._connections.setdefault(key, []).append(target)

    def after(self, road: XRoad, section: int, lane: RoadLane) -> list[tuple[str, int, int]]:
        """(road, section, lane) of what one can drive onto at the end of a lane, in its driving direction."""
        forward = road.forward(lane.number)
        step, name = (1, "successor") if forward else (-1, "predecessor")
        following = lane.successor if forward else lane.predecessor
        if 0 <= section + step < len(road.sections):
            found = [] if following is None else [(road.road_id, section + step, following)]
        else:
            found = self._across(road, name, lane.number, following)
        return [target for target in found if self._drivable(target)]

    def _across(self, road: XRoad, end: str, lane: int, following: int | None) -> list[tuple[str, int, int]]:
        kind, element, contact = road.links.get(end, ("", "", ""))
        if kind == "road":
            return [] if following is None else self._entered(element, contact, following)
        found = []
        for target, point, lanes in self._connections.get((element, road.road_id), ()) if kind == "junction" else ():
            if lane in lanes:
                found += self._entered(target, point, lanes[lane])
        return found

    def _entered(self, road_id: str, contact: str, lane: int) -> list[tuple[str, int, int]]:
        """The lane of a road that is entered at its start or end, if it is driven from there."""
        road = self.roads.get(road_id)
        if road is None or lane == 0 or road.forward(lane) != (contact != "end"):
            return []
        return [(road_id, 0 if contact != "end" else len(road.sections) - 1, lane)]

    def _drivable(self, target: tuple[str, int, int]) -> bool:
        road_id, section, number = target
        lane = self.roads[road_id].sections[section].lanes.get(number) if self.roads[road_id].sections else None
        return lane is not None and lane.kind in DRIVABLE
