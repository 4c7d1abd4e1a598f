"""Regulatory elements of a lanelet2 map: speed limits, stop lines, and which light is for which lanelet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.osm import Document, Relation, Way
from stylesim.datasets.maps.site_map import MapLight
from stylesim.datasets.maps.units import speed_mps
from stylesim.geometry import project

# Chosen: a stop line belongs to a lanelet whose middle comes this close to it; half of a lane is 1.5 m or more.
NEAR_M = 1.0
END_SHARE = 0.25  # chosen: a stop line lies in the last quarter of its lanelet, or where the next one begins


@dataclass(frozen=True)
class Rules:
    """The regulatory elements of one map."""

    elements: Mapping[str, Relation]
    ways: Mapping[str, Way]
    stop_lines: tuple[Way, ...]

    @classmethod
    def of(cls, document: Document) -> Rules:
        """The rules of that document."""
        elements = {i: r for i, r in document.relations.items() if r.tags.get("type") == "regulatory_element"}
        lines = {w.way_id: w for w in document.ways.values() if w.kind == "stop_line" and len(w.points_m) >= 2}
        for element in elements.values():
            for ref in element.refs("ref_line", "way"):
                if ref in document.ways and len(document.ways[ref].points_m) >= 2:
                    lines[ref] = document.ways[ref]
        return cls(elements, document.ways, tuple(lines.values()))

    def speed_limit_mps(self, lanelet: Relation) -> float:
        """The lanelet's own tag, else the limit of its speed_limit element; NaN where neither says it."""
        own = speed_mps(lanelet.tags.get("speed_limit"))
        if not math.isnan(own):
            return own
        for ref in lanelet.refs("regulatory_element", "relation"):
            element = self.elements.get(ref)
            if element is not None and element.tags.get("subtype") == "speed_limit":
                sign = speed_mps(element.tags.get("sign_type"))
                return sign if not math.isnan(sign) else speed_mps(element.tags.get("limit"))
        return math.nan

    def stop_line(
        self, lanelet: Relation, centre_m: Float64[np.ndarray, "point 2"]
    ) -> Float64[np.ndarray, "2 2"] | None:
        """Both ends of the line at which this lanelet stops; None without one.

        Lines of the lanelet's own elements come first, then every line that lies across its end.
        """
        own = [
            self.ways[line]
            for ref in lanelet.refs("regulatory_element", "relation")
            if ref in self.elements
            for line in self.elements[ref].refs("ref_line", "way")
            if line in self.ways and len(self.ways[line].points_m) >= 2
        ]
        for lines, reach in ((own, 3 * NEAR_M), (self.stop_lines, NEAR_M)):
            distances = [_distance_to_end(line, centre_m) for line in lines]
            if distances and min(distances) <= reach:
                points = lines[int(np.argmin(distances))].points_m
                return np.stack([points[0], points[-1]])
        return None

    def lights(
        self, lanelets: Mapping[str, Relation], centres_m: Mapping[str, Float64[np.ndarray, "point 2"]]
    ) -> tuple[MapLight, ...]:
        """Every light, with the lanelets that name it or, where none does, those that end at its stop line."""
        users: dict[str, list[str]] = {}
        for lane_id in centres_m:
            for ref in lanelets[lane_id.removesuffix("/reverse")].refs("regulatory_element", "relation"):
                users.setdefault(ref, []).append(lane_id)
        lights = []
        for element_id, element in self.elements.items():
            if element.tags.get("subtype") != "traffic_light":
                continue
            lanes = tuple(users.get(element_id, ())) or self._by_stop_line(element, centres_m)
            for ref in element.refs("refers", "way") or (element_id,):
                name = self.ways[ref].tags.get("name", "") if ref in self.ways else ""
                lights.append(MapLight(ref, name, lanes))
        return tuple(lights)

    def _by_stop_line(
        self, element: Relation, centres_m: Mapping[str, Float64[np.ndarray, "point 2"]]
    ) -> tuple[str, ...]:
        lines = [self.ways[ref] for ref in element.refs("ref_line", "way") if ref in self.ways]
        return tuple(
            lane_id
            for lane_id, centre in centres_m.items()
            if any(len(line.points_m) >= 2 and _distance_to_end(line, centre) <= NEAR_M for line in lines)
        )


def _distance_to_end(line: Way, centre_m: Float64[np.ndarray, "point 2"]) -> float:
    """How close the last part of a centre line comes to a stop line."""
    last = centre_m[int((1 - END_SHARE) * (len(centre_m) - 1)) :]
    _, _, distance, _ = project(last, line.points_m)
    return float(distance.min())
