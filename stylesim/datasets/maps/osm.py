"""The OpenStreetMap XML that lanelet2 maps are written in: nodes, ways and relations, resolved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.projection import Projector
from stylesim.errors import InputError
from stylesim.xmlfiles import parse

MAX_COORDINATE_M = 5e7  # of any projection of a place on Earth


@dataclass(frozen=True, eq=False)
class Way:
    """A line: its nodes' ids and places in metres."""

    way_id: str
    nodes: tuple[str, ...]
    points_m: Float64[np.ndarray, "point 2"]
    tags: Mapping[str, str]

    @property
    def kind(self) -> str:
        """The value of `type`."""
        return self.tags.get("type", "")


@dataclass(frozen=True)
class Relation:
    """A relation: its members as (role, kind, id)."""

    relation_id: str
    members: tuple[tuple[str, str, str], ...]
    tags: Mapping[str, str]

    def refs(self, role: str, kind: str) -> tuple[str, ...]:
        """Ids of the members in that role ("left", …) of that kind ("way", "relation")."""
        return tuple(ref for r, k, ref in self.members if r == role and k == kind)


@dataclass(frozen=True)
class Document:
    """All of it; `notes` counts ways and relations that name something that is not there."""

    ways: Mapping[str, Way]
    relations: Mapping[str, Relation]
    notes: Mapping[str, int]


def read_osm(path: Path, projector: Projector) -> Document:
    """The document, projected. Elements that an editor marked as deleted are not there.

    Positions are `lat` and `lon` through the projector, or the tags `local_x`, `local_y` where every node has them.
    InputError where the file is damaged, or a place is no place on Earth.
    """
    root = parse(path, root="osm")
    try:
        places = _places(root, projector)
        ways, dangling = _ways(root, places)
        relations = {r.get("id", ""): _relation(r) for r in root.findall("relation") if r.get("action") != "delete"}
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path} is a damaged map: {error}") from error
    return Document(ways, relations, {"map_ways_incomplete": dangling} if dangling else {})


def _places(root: Element, projector: Projector) -> dict[str, Float64[np.ndarray, " 2"]]:
    nodes = [n for n in root.findall("node") if n.get("action") != "delete"]
    if not nodes:
        return {}
    tags = [_tags(n) for n in nodes]
    if all("local_x" in t and "local_y" in t for t in tags):
        xy = np.array([(float(t["local_x"]), float(t["local_y"])) for t in tags])
    else:
        lat = np.array([float(n.get("lat", "nan")) for n in nodes])
        lon = np.array([float(n.get("lon", "nan")) for n in nodes])
        if not (np.abs(lat) <= 90).all() or not (np.abs(lon) <= 180).all():
            raise ValueError("a node's latitude or longitude is missing or no place on Earth")
        with np.errstate(all="ignore"):  # the pole lies at infinity
            xy = projector(lat, lon)
    if not (np.abs(xy) <= MAX_COORDINATE_M).all():
        raise ValueError("a node has no place, or one that is farther away than the Earth is round")
    return {n.get("id", ""): place for n, place in zip(nodes, xy, strict=True)}


def _ways(root: Element, places: Mapping[str, Float64[np.ndarray, " 2"]]) -> tuple[dict[str, Way], int]:
    ways, dangling = {}, 0
    for element in root.findall("way"):
        if element.get("action") == "delete":
            continue
        nodes = tuple(nd.get("ref", "") for nd in element.findall("nd"))
        if not nodes or any(node not in places for node in nodes):
            dangling += 1
            continue
        way_id = element.get("id", "")
        ways[way_id] = Way(way_id, nodes, np.array([places[n] for n in nodes]), _tags(element))
    return ways, dangling


def _relation(element: Element) -> Relation:
    members = tuple((m.get("role", ""), m.get("type", ""), m.get("ref", "")) for m in element.findall("member"))
    return Relation(element.get("id", ""), members, _tags(element))


def _tags(element: Element) -> dict[str, str]:
    return {t.get("k", ""): t.get("v", "") for t in element.findall("tag")}
