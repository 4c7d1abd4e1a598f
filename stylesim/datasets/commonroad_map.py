"""The road of a CommonRoad scenario: lanelets, limits, stop lines, crosswalks, and which light is for which lanelet."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.shapes import between, distinct
from stylesim.datasets.maps.site_map import MapLight, SiteMap, site_map, with_junctions
from stylesim.road import Lane

# Signs of a maximum speed in the catalogues of the format [read]: Germany, Zamunda (made-up), USA, Spain and others.
LIMIT_SIGNS = frozenset({"274", "R2-1", "r301", "R301", "274.1", "maxSpeed", "max_speed"})
MAX_COORDINATE_M = 5e7  # chosen: of any projection of a place on Earth
# Lanelets that no motor vehicle drives on.
NOT_DRIVEN = frozenset({"sidewalk", "crosswalk", "bicycleLane", "border", "restricted"})


def read_road(root: Element, origin_m: Float64[np.ndarray, " 2"]) -> SiteMap | None:
    """The road in metres from `origin_m`; None without lanelets. ValueError where the numbers make none.

    Speed limits are m/s: `speedLimit` of version 2018b, the value of a sign of version 2020a. Which lanelets lie in a
    junction follows from the intersections (what their incoming lanelets lead to) and from lanes that cross.
    """
    elements = root.findall("lanelet")
    if not elements:
        return None
    limits = _sign_limits(root)
    kinds = {e.get("id", ""): {t.text for t in e.findall("laneletType")} for e in elements}
    lanes, walks, broken = [], [], 0
    lights: dict[str, list[str]] = {}
    for element in elements:
        lane_id = element.get("id", "")
        try:
            left, right = (distinct(points(element.find(side))) for side in ("leftBound", "rightBound"))
            lane = _lane(element, left, right, limits, origin_m)
        except ValueError:
            broken += 1  # a bound without length: the lane has none
            continue
        if "crosswalk" in kinds[lane_id]:
            walks.append((np.concatenate([left, right[::-1]]) - origin_m).astype(np.float32))
        if kinds[lane_id] & NOT_DRIVEN:
            continue
        lanes.append(lane)
        for ref in element.findall("trafficLightRef"):
            lights.setdefault(ref.get("ref", ""), []).append(lane_id)
    if len({lane.lane_id for lane in lanes}) != len(lanes):
        raise ValueError("two lanelets have the same id")
    inside = set(_in_junctions(root))
    marked = tuple(
        replace(lane, in_junction=True) if lane.lane_id in inside else lane for lane in with_junctions(lanes)
    )
    known = {light.get("id", "") for light in root.findall("trafficLight")}
    return site_map(
        marked,
        crosswalks_m=tuple(walks),
        lights=tuple(MapLight(i, "", tuple(ids)) for i, ids in lights.items() if i in known),
        notes={"map_lanes_incomplete": broken} if broken else {},
    )


def points(bound: Element | None) -> Float64[np.ndarray, "point 2"]:
    """The points of an element. ValueError where there is no element, or a coordinate is none."""
    if bound is None:
        raise ValueError("a lanelet has no bound")
    xy = [(float(p.findtext("x", "nan")), float(p.findtext("y", "nan"))) for p in bound.findall("point")]
    line = np.array(xy, np.float64).reshape(-1, 2)
    if not (np.abs(line) < MAX_COORDINATE_M).all():
        raise ValueError("a point of the map has no usable place")
    return line


def _lane(
    element: Element,
    left: Float64[np.ndarray, "left 2"],
    right: Float64[np.ndarray, "right 2"],
    limits: dict[str, float],
    origin_m: Float64[np.ndarray, " 2"],
) -> Lane:
    # The format pairs the points of both bounds; the centre is the middle of each pair.
    if len(left) == len(right):
        centre, width = distinct((left + right) / 2), float(np.median(np.hypot(*(left - right).T)))
    else:
        centre, width = between(left, right)
    limit = float(element.findtext("speedLimit", "nan"))
    for ref in element.findall("trafficSignRef"):
        limit = limits.get(ref.get("ref", ""), limit)
    stop = element.find("stopLine")
    line = None
    if stop is not None:
        ends = points(stop)
        line = ends[[0, -1]] if len(ends) >= 2 else np.stack([left[-1], right[-1]])  # without points: at the end
        if not np.isfinite(line).all():
            raise ValueError("a stop line is not finite")
    return Lane(
        lane_id=element.get("id", ""),
        centre_line_m=centre - origin_m,
        width_m=width,
        speed_limit_mps=limit if 0 < limit < 100 else math.nan,
        left_boundary_m=left - origin_m,
        right_boundary_m=right - origin_m,
        successors=tuple(e.get("ref", "") for e in element.findall("successor")),
        left_neighbour=_beside(element, "adjacentLeft"),
        right_neighbour=_beside(element, "adjacentRight"),
        stop_line_m=None if line is None else line - origin_m,
    )


def _beside(element: Element, side: str) -> str:
    found = element.find(side)
    return found.get("ref", "") if found is not None and found.get("drivingDir") == "same" else ""


def _sign_limits(root: Element) -> dict[str, float]:
    limits = {}
    for sign in root.findall("trafficSign"):
        for one in sign.findall("trafficSignElement"):
            if one.findtext("trafficSignID", "") in LIMIT_SIGNS:
                limits[sign.get("id", "")] = float(one.findtext("additionalValue", "nan"))
    return limits


def _in_junctions(root: Element) -> Iterator[str]:
    for intersection in root.findall("intersection"):
        for incoming in intersection.findall("incoming"):
            for name in ("successorsLeft", "successorsRight", "successorsStraight"):
                yield from (e.get("ref", "") for e in incoming.findall(name))
