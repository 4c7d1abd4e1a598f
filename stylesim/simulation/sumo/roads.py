"""Reads a compiled SUMO network: the lanes as `Road`, and which signal link controls which lane."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.road import Lane, Road


@dataclass(frozen=True)
class SignalLink:
    """One movement that a signal controls: position in its state string, the lane it starts from, its direction."""

    signal: str
    index: int
    edge: str
    lane: str
    direction: str  # SUMO's: s straight, l left, r right


@dataclass(frozen=True)
class RoadNetwork:
    """What is read of a compiled network."""

    road: Road
    links: tuple[SignalLink, ...]
    length_m: dict[str, float]  # of each lane, as SUMO counts it
    edges: tuple[str, ...]  # those between junctions
    ends: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # of those: the nodes from which and to which

    def signals(self) -> tuple[str, ...]:
        """The ids of its signals, sorted."""
        return tuple(sorted({link.signal for link in self.links}))

    def controlled_lanes(self) -> tuple[str, ...]:
        """The lanes that end at a signal, sorted."""
        return tuple(sorted({link.lane for link in self.links}))


def _shape(text: str) -> Float64[np.ndarray, "point 2"]:
    points = np.array([[float(value) for value in point.split(",")[:2]] for point in text.split()])
    moved = np.hypot(*np.diff(points, axis=0).T) > 1e-6
    return points[np.concatenate([[True], moved])]


def _stop_line(shape: Float64[np.ndarray, "point 2"], width_m: float) -> Float64[np.ndarray, "2 2"]:
    """Across the lane at its end, from its right to its left side."""
    along = shape[-1] - shape[-2]
    left = np.array([-along[1], along[0]]) / np.hypot(*along) * width_m / 2
    return np.stack([shape[-1] - left, shape[-1] + left])


@lru_cache(maxsize=32)
def read_network(path: Path) -> RoadNetwork:
    """The network at `path` (a net of this package's compiling; lanes inside junctions are included)."""
    root = ET.parse(path).getroot()
    edges = [e for e in root.findall("edge") if e.get("function", "normal") in ("normal", "internal", "connector")]
    successors: dict[str, list[str]] = defaultdict(list)
    links: list[SignalLink] = []
    for item in root.findall("connection"):
        start = f"{item.attrib['from']}_{item.attrib['fromLane']}"
        successors[start].append(item.get("via") or f"{item.attrib['to']}_{item.attrib['toLane']}")
        if item.get("tl"):
            links.append(
                SignalLink(
                    item.attrib["tl"], int(item.attrib["linkIndex"]), item.attrib["from"], start, item.attrib["dir"]
                )
            )
    controlled = {link.lane for link in links}
    crossings = _crossings(edges)
    lanes = [lane for edge in edges for lane in _lanes(edge, successors, controlled, crossings)]
    outer = tuple(e.attrib["id"] for e in edges if e.get("function") != "internal")
    ends = {
        e.attrib["id"]: (e.attrib["from"], e.attrib["to"]) for e in edges if "from" in e.attrib and "to" in e.attrib
    }
    length = {lane.attrib["id"]: float(lane.attrib["length"]) for edge in edges for lane in edge.findall("lane")}
    ordered = tuple(sorted(links, key=lambda link: (link.signal, link.index)))
    return RoadNetwork(Road(tuple(lanes)), ordered, length, outer, ends)


def _for_cars(lane: ET.Element) -> bool:
    """Whether passenger cars may use it (no sidewalk, bus lane or railway)."""
    allowed, barred = lane.get("allow"), (lane.get("disallow") or "").split()
    return ("passenger" in allowed.split() or allowed == "all") if allowed else not {"passenger", "all"} & set(barred)


def _crossings(edges: list[ET.Element]) -> set[str]:
    """Nodes where streams can cross: two or more edges come in and two or more go out.

    A motorway merge, lane drop or exit is none: traffic there is on one road, which is what the context asks.
    """
    coming = Counter(edge.attrib["to"] for edge in edges if "to" in edge.attrib)
    going = Counter(edge.attrib["from"] for edge in edges if "from" in edge.attrib)
    return {node for node in coming if coming[node] >= 2 and going[node] >= 2}


def _lanes(edge: ET.Element, successors: dict[str, list[str]], controlled: set[str], crossings: set[str]) -> list[Lane]:
    """The lanes of one edge for cars, right to left; lanes too short to have a direction are left out."""
    elements = [element for element in edge.findall("lane") if _for_cars(element)]
    ids = [element.attrib["id"] for element in elements]
    internal = edge.get("function") == "internal"
    crossing = internal and edge.attrib["id"].removeprefix(":").rsplit("_", 1)[0] in crossings
    lanes = []
    for index, element in enumerate(elements):
        shape, width = _shape(element.attrib["shape"]), float(element.get("width", "3.2"))
        if len(shape) < 2:
            continue
        lanes.append(
            Lane(
                lane_id=ids[index],
                centre_line_m=shape.astype(np.float32),
                width_m=width,
                speed_limit_mps=float(element.attrib["speed"]),
                successors=tuple(successors[ids[index]]),
                left_neighbour=ids[index + 1] if index + 1 < len(ids) else "",
                right_neighbour=ids[index - 1] if index else "",
                in_junction=crossing,
                stop_line_m=_stop_line(shape, width).astype(np.float32) if ids[index] in controlled else None,
            )
        )
    return lanes
