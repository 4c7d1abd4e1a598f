"""lanelet2 maps (OSM XML): the maps of INTERACTION, TAF-BW, SinD and levelXData.

A lanelet is a lane between two ways; what follows what is told by shared nodes, what lies beside what by shared
ways, as in the library's routing graph. Regulatory elements carry speed limits, stop lines and lights.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.lanelet2_rules import Rules
from stylesim.datasets.maps.osm import Document, Relation, Way, read_osm
from stylesim.datasets.maps.projection import Projector
from stylesim.datasets.maps.shapes import aligned, between, distinct
from stylesim.datasets.maps.site_map import SiteMap, site_map, with_junctions
from stylesim.errors import InputError
from stylesim.road import Lane

# Lanelets for motor traffic, from the subtypes of lanelet2's documentation; without a subtype it is a road there.
DRIVABLE = ("", "road", "highway", "play_street", "bus_lane", "emergency_lane", "exit")
_WALKS = ("crosswalk",)


@dataclass(frozen=True, eq=False)
class _Bounds:
    """The two sides of one lanelet in driving direction."""

    left: Way
    right: Way
    left_m: Float64[np.ndarray, "left 2"]
    right_m: Float64[np.ndarray, "right 2"]
    left_nodes: tuple[str, ...]
    right_nodes: tuple[str, ...]

    def reversed(self) -> _Bounds:
        """The same ground driven the other way."""
        return _Bounds(
            self.right,
            self.left,
            self.right_m[::-1],
            self.left_m[::-1],
            self.right_nodes[::-1],
            self.left_nodes[::-1],
        )


def read_lanelet2(path: Path, projector: Projector, origin_m: Float64[np.ndarray, " 2"]) -> SiteMap:
    """The map in metres from `origin_m`, which is in the projector's frame.

    Lane ids are the lanelets' own; a lanelet for both directions gives two, the second with "/reverse".
    Lanelets without two usable bounds are left out and counted. InputError where the file is damaged or no map.
    """
    document = read_osm(path, projector)
    rules = Rules.of(document)
    lanelets = {i: r for i, r in document.relations.items() if r.tags.get("type") == "lanelet"}
    if not lanelets:
        raise InputError(f"{path} has no lanelet; it is OpenStreetMap, but no lanelet2 map")
    bounds, walks, broken = _all_bounds(document, lanelets)
    if not bounds:
        raise InputError(f"{path} has {len(lanelets)} lanelets, but none for motor traffic with two usable bounds")
    following = _followers(bounds)
    lefts = {(b.left.way_id, b.left_nodes[0]): i for i, b in bounds.items()}
    rights = {(b.right.way_id, b.right_nodes[0]): i for i, b in bounds.items()}
    lanes = []
    for lane_id, one in bounds.items():
        centre, width = between(one.left_m, one.right_m)
        relation = lanelets[lane_id.removesuffix("/reverse")]
        stop = rules.stop_line(relation, centre)
        lanes.append(
            Lane(
                lane_id=lane_id,
                centre_line_m=centre - origin_m,
                width_m=width,
                speed_limit_mps=rules.speed_limit_mps(relation),
                left_boundary_m=one.left_m - origin_m,
                right_boundary_m=one.right_m - origin_m,
                successors=following[lane_id],
                left_neighbour=rights.get((one.left.way_id, one.left_nodes[0]), ""),
                right_neighbour=lefts.get((one.right.way_id, one.right_nodes[0]), ""),
                stop_line_m=None if stop is None else stop - origin_m,
            )
        )
    marked = with_junctions(lanes)
    centres = {lane.lane_id: lane.centre_line_m.astype(np.float64) + origin_m for lane in marked}
    marked = tuple(_turning(lane, lanelets[lane.lane_id.removesuffix("/reverse")]) for lane in marked)
    notes = dict(document.notes) | ({"map_lanes_incomplete": broken} if broken else {})
    return site_map(
        marked,
        crosswalks_m=tuple((w - origin_m).astype(np.float32) for w in walks),
        lights=rules.lights(lanelets, centres),
        notes=notes,
    )


def _turning(lane: Lane, relation: Relation) -> Lane:
    """Maps with `turn_direction` say by it which lanelets lie in a junction."""
    return replace(lane, in_junction=True) if relation.tags.get("turn_direction") else lane


def _all_bounds(
    document: Document, lanelets: Mapping[str, Relation]
) -> tuple[dict[str, _Bounds], list[Float64[np.ndarray, "_ 2"]], int]:
    bounds: dict[str, _Bounds] = {}
    walks, broken = [], 0
    for lane_id, relation in lanelets.items():
        subtype = relation.tags.get("subtype", "")
        if subtype not in (*DRIVABLE, *_WALKS):
            continue
        one = _bounds(document, relation)
        if one is None:
            broken += 1
        elif subtype in _WALKS:
            walks.append(np.concatenate([one.left_m, one.right_m[::-1]]))
        else:
            bounds[lane_id] = one
            if relation.tags.get("one_way", "yes") in ("no", "false", "0"):
                bounds[f"{lane_id}/reverse"] = one.reversed()
    return bounds, walks, broken


def _bounds(document: Document, relation: Relation) -> _Bounds | None:
    sides = []
    for role in ("left", "right"):
        ways = [document.ways.get(ref) for ref in relation.refs(role, "way")]
        if not ways or any(way is None for way in ways):
            return None
        sides.append(_joined([way for way in ways if way is not None]))
    left, right = sides
    if left is None or right is None:
        return None
    try:
        left_line, right_line = distinct(left.points_m), distinct(right.points_m)
        left_m, right_m, left_turned, right_turned = aligned(left_line, right_line)
        between(left_m, right_m)
    except ValueError:
        return None
    return _Bounds(
        left,
        right,
        left_m,
        right_m,
        left.nodes[::-1] if left_turned else left.nodes,
        right.nodes[::-1] if right_turned else right.nodes,
    )


def _joined(ways: list[Way]) -> Way | None:
    """Ways that one side is made of, end to end; None where they do not meet."""
    nodes, points = ways[0].nodes, ways[0].points_m
    for i, way in enumerate(ways[1:]):
        if i == 0 and nodes[-1] not in (way.nodes[0], way.nodes[-1]):
            nodes, points = nodes[::-1], points[::-1]
        if nodes[-1] == way.nodes[0]:
            nodes, points = nodes + way.nodes[1:], np.concatenate([points, way.points_m[1:]])
        elif nodes[-1] == way.nodes[-1]:
            nodes, points = nodes + way.nodes[-2::-1], np.concatenate([points, way.points_m[-2::-1]])
        else:
            return None
    return Way("+".join(way.way_id for way in ways), nodes, points, ways[0].tags)


def _followers(bounds: Mapping[str, _Bounds]) -> dict[str, tuple[str, ...]]:
    begins: dict[tuple[str, str], list[str]] = defaultdict(list)
    for lane_id, one in bounds.items():
        begins[one.left_nodes[0], one.right_nodes[0]].append(lane_id)
    found = {}
    for lane_id, one in bounds.items():
        own = lane_id.removesuffix("/reverse")
        after = begins.get((one.left_nodes[-1], one.right_nodes[-1]), [])
        found[lane_id] = tuple(i for i in after if i.removesuffix("/reverse") != own)
    return found
