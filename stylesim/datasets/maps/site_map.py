"""`SiteMap`: what a map file says about a site."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.maps.shapes import crossed
from stylesim.road import Lane, Road


@dataclass(frozen=True, eq=False)
class MapLight:
    """One light of a map, and the lanes that it controls."""

    light_id: str
    name: str  # what the map calls it; "" without a name
    lane_id: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SiteMap:
    """The road in metres from the origin that its reader chose, the lights, and what was left out and why."""

    road: Road
    lights: tuple[MapLight, ...] = ()
    notes: Mapping[str, int] = field(default_factory=dict)

    def light_lanes(self, signal_id: Sequence[str]) -> tuple[tuple[str, ...], ...]:
        """The lanes of each logged light, found by the light's id or name; () where the map does not know it."""
        known = {light.name: light.lane_id for light in self.lights if light.name}
        known |= {light.light_id: light.lane_id for light in self.lights}
        return tuple(known.get(name, ()) for name in signal_id)


def site_map(lanes: Sequence[Lane], **rest: object) -> SiteMap:
    """A map of these lanes whose ids of successors and neighbours are all known; others are left out."""
    known = {lane.lane_id for lane in lanes}
    linked = tuple(
        replace(
            lane,
            successors=tuple(dict.fromkeys(i for i in lane.successors if i in known)),
            left_neighbour=lane.left_neighbour if lane.left_neighbour in known else "",
            right_neighbour=lane.right_neighbour if lane.right_neighbour in known else "",
        )
        for lane in lanes
    )
    walks = rest.pop("crosswalks_m", ())
    return SiteMap(road=Road(lanes=linked, source="map", crosswalks_m=walks), **rest)  # type: ignore[arg-type]


def with_junctions(lanes: Sequence[Lane]) -> tuple[Lane, ...]:
    """The lanes with `in_junction` set where one crosses another: for formats that do not say it themselves."""
    lines: list[Float64[np.ndarray, "_ 2"]] = [lane.centre_line_m.astype(np.float64) for lane in lanes]
    return tuple(
        replace(lane, in_junction=True) if hit else lane for lane, hit in zip(lanes, crossed(lines), strict=True)
    )
