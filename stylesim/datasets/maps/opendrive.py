"""OpenDRIVE maps (XML, versions 1.1 to 1.8): lanes with their boundaries, limits, links, lights and stop lines.

Read: plan view, lane offset, lane sections, widths and borders, links over sections, roads and junctions, speeds of
roads and lanes, signals with their validity. Heights and superelevation are dropped: everything here is a plan.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.opendrive_lanes import DRIVABLE, Network, Section, XRoad, road_of
from stylesim.datasets.maps.shapes import MAX_STATIONS, STATION_M, distinct
from stylesim.datasets.maps.site_map import MapLight, SiteMap, site_map
from stylesim.datasets.maps.xml import parse
from stylesim.errors import InputError
from stylesim.road import Lane

FAR_M = 100_000.0  # coordinates beyond it are a grid of a country (UTM), below it a local frame
MIN_WIDTH_M = 0.5  # chosen: a lane that is narrower all along its section carries no vehicle
MAX_TOTAL = 5_000_000  # chosen: points of all lanes; bounds what a damaged file can ask for
STOP_LINE_TYPES = frozenset({"294"})  # the stop line of German and Austrian sign catalogues


def read_opendrive(
    path: Path, origin_m: Float64[np.ndarray, " 2"], *, utm_origin_m: Float64[np.ndarray, " 2"] | None = None
) -> SiteMap:
    """The map in metres from `origin_m`. Lane ids are "<road>_<section>_<lane>".

    Where the file's coordinates (with the offset of its header) are those of a country's grid, `utm_origin_m` is
    subtracted first: the frame of a recording that counts from there. InputError where the file is damaged or no map.
    """
    document = parse(path, root="OpenDRIVE")
    try:
        roads = {element.get("id", ""): road_of(element) for element in document.findall("road")}
        network = Network(roads, document)
        shift = _shift(document, roads, utm_origin_m) - origin_m
        lanes: list[Lane] = []
        total = 0
        for road in roads.values():
            before = len(lanes)
            for k, section in enumerate(road.sections):
                lanes += _section_lanes(network, road, k, section, shift)
            total += sum(len(lane.centre_line_m) for lane in lanes[before:])
            if total > MAX_TOTAL:
                raise ValueError(f"more than {MAX_TOTAL} points of lanes")
        lights, stops = _signals(document, roads, shift)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path} is a damaged OpenDRIVE map: {error}") from error
    if not lanes:
        raise InputError(f"{path} has no lane for motor traffic")
    known = {lane.lane_id for lane in lanes}
    with_stops = [replace(lane, stop_line_m=stops[lane.lane_id]) if lane.lane_id in stops else lane for lane in lanes]
    kept = tuple(replace(light, lane_id=tuple(i for i in light.lane_id if i in known)) for light in lights)
    return site_map(with_stops, lights=kept)


def _shift(
    document: Element, roads: Mapping[str, XRoad], utm_origin_m: Float64[np.ndarray, " 2"] | None
) -> Float64[np.ndarray, " 2"]:
    """What is added to the file's coordinates."""
    offset = document.find("header/offset")
    shift = np.zeros(2) if offset is None else np.array([float(offset.get("x", 0)), float(offset.get("y", 0))])
    if not np.isfinite(shift).all():
        raise ValueError("the offset of the header is no number")
    places = [(piece[2], piece[3]) for road in roads.values() for piece in road.plan.pieces]
    if places and utm_origin_m is not None and np.abs(np.median(np.array(places) + shift, axis=0)).max() > FAR_M:
        shift = shift - utm_origin_m
    return shift


def _stations(road: XRoad, section: Section) -> Float64[np.ndarray, " s"]:
    length = section.end - section.start
    count = int(np.clip(np.ceil(length / STATION_M) + 1, 3, MAX_STATIONS))
    knots = [s for s in road.plan.starts if section.start < s < section.end]
    return np.unique(np.concatenate([np.linspace(section.start, section.end, count), knots]))


def _borders(
    road: XRoad, section: Section, s: Float64[np.ndarray, " s"]
) -> dict[int, tuple[Float64[np.ndarray, " s"], Float64[np.ndarray, " s"]]]:
    """Inner and outer t of each lane at the stations."""
    found = {}
    for side in (1, -1):
        inner = road.offset.at(s)
        numbers = sorted((n for n in section.lanes if n * side > 0), key=abs)
        for number in numbers:
            lane = section.lanes[number]
            value = lane.width.at(s - section.start)
            outer = road.offset.at(s) + value if lane.is_border else inner + side * np.maximum(value, 0.0)
            found[number] = (inner, outer)
            inner = outer
    return found


def _section_lanes(
    network: Network, road: XRoad, k: int, section: Section, shift: Float64[np.ndarray, " 2"]
) -> list[Lane]:
    if section.end - section.start < 1e-3:
        return []
    s = _stations(road, section)
    place, direction = road.plan.at(s)
    if not np.isfinite(place).all():
        raise ValueError(f"road {road.road_id!r}: its line is not finite")
    normal = np.stack([-np.sin(direction), np.cos(direction)], axis=1)
    lanes = []
    for number, (inner, outer) in _borders(road, section, s).items():
        lane = section.lanes[number]
        width = float(np.median(np.abs(outer - inner)))
        if lane.kind not in DRIVABLE or np.abs(outer - inner).max() < MIN_WIDTH_M:
            continue
        forward = road.forward(number)
        high, low = np.maximum(inner, outer), np.minimum(inner, outer)
        left, right = (high, low) if forward else (low, high)
        order = slice(None) if forward else slice(None, None, -1)
        lines = [
            (place + t[:, None] * normal + shift)[order].astype(np.float64) for t in ((left + right) / 2, left, right)
        ]
        step = 1 if number > 0 else -1
        beside = {number - step: "inner", number + step: "outer"}
        names = {
            where: f"{road.road_id}_{k}_{n}"
            for n, where in beside.items()
            if n * number > 0 and n in section.lanes and section.lanes[n].kind in DRIVABLE
        }
        # Seen along the driving direction the inner lane is on the left, but for left-hand traffic.
        inner_left = road.forward_right
        lanes.append(
            Lane(
                lane_id=f"{road.road_id}_{k}_{number}",
                centre_line_m=distinct(lines[0]),
                width_m=width,
                speed_limit_mps=lane.limit_mps,
                left_boundary_m=lines[1],
                right_boundary_m=lines[2],
                successors=tuple(f"{r}_{i}_{n}" for r, i, n in network.after(road, k, lane)),
                left_neighbour=names.get("inner" if inner_left else "outer", ""),
                right_neighbour=names.get("outer" if inner_left else "inner", ""),
                in_junction=bool(road.junction),
            )
        )
    return lanes


def _signals(
    document: Element, roads: Mapping[str, XRoad], shift: Float64[np.ndarray, " 2"]
) -> tuple[list[MapLight], dict[str, Float64[np.ndarray, "2 2"]]]:
    """Lights with the lanes for which they are valid, and the stop line of each lane that has one."""
    lights, stops = [], {}
    for element in document.findall("road"):
        road = roads[element.get("id", "")]
        for signal in element.findall("signals/signal"):
            s = float(signal.get("s", "nan"))
            k = next((i for i, part in enumerate(road.sections) if part.start <= s <= part.end + 1e-3), None)
            if k is None or math.isnan(s):
                continue
            numbers = _valid_for(signal, road, road.sections[k])
            ids = tuple(f"{road.road_id}_{k}_{n}" for n in numbers)
            if signal.get("dynamic") == "yes":
                lights.append(MapLight(signal.get("id", ""), signal.get("name", ""), ids))
            elif signal.get("type") in STOP_LINE_TYPES:
                at = np.array([s])
                place, direction = road.plan.at(at)
                normal = np.array([-np.sin(direction[0]), np.cos(direction[0])])
                borders = _borders(road, road.sections[k], at)
                for number, lane_id in zip(numbers, ids, strict=True):
                    ends = np.array([borders[number][0][0], borders[number][1][0]])
                    stops[lane_id] = place[0] + shift + ends[:, None] * normal
    return lights, stops


def _valid_for(signal: Element, road: XRoad, section: Section) -> list[int]:
    """Numbers of the lanes that a signal is for: its validity, else every lane in its orientation."""
    spans = [(int(v.get("fromLane", "0")), int(v.get("toLane", "0"))) for v in signal.findall("validity")]
    drivable = [n for n, lane in section.lanes.items() if lane.kind in DRIVABLE]
    if spans:
        return [n for n in drivable if any(min(span) <= n <= max(span) for span in spans)]
    orientation = signal.get("orientation", "none")
    if orientation not in ("+", "-"):
        return drivable
    return [n for n in drivable if road.forward(n) == (orientation == "+")]
