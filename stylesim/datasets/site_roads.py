"""Frozen roads of known sites: inferred once from a recording, shipped, the same for every later recording there.

A road that is inferred from the recording under study knows its future; one that was frozen before does not.
The drivers that it was made from are named in its evidence, so that each is still left out of its own lane.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.errors import InputError
from stylesim.road import Lane, LaneEvidence, Road

FORMAT = "stylesim-site-road"
VERSION = 1
_SHIPPED = Path(__file__).resolve().parent / "sites"
MARGIN_M = 20.0  # chosen: a recording that begins this close to the lanes is of the same site


@dataclass(frozen=True, eq=False)
class SiteRoad:
    """The road of one site in metres from `origin_m` (in the source's frame), and what it was made from."""

    name: str
    road: Road
    origin_m: Float64[np.ndarray, " 2"]
    provenance: Mapping[str, Any]

    def holds(self, position_m: Float64[np.ndarray, " 2"]) -> bool:
        """True if that place (in the source's frame) lies within the box of the lanes."""
        points = np.concatenate([lane.centre_line_m for lane in self.road.lanes]) + self.origin_m
        inside = (position_m >= points.min(axis=0) - MARGIN_M) & (position_m <= points.max(axis=0) + MARGIN_M)
        return bool(inside.all())


def site_road_at(source: str, position_m: Float64[np.ndarray, " 2"]) -> SiteRoad | None:
    """The shipped road of that source around a place; None where none is known."""
    for file in sorted(_SHIPPED.glob(f"{source}_*.json")):
        site = load_site_road(file)
        if site.holds(position_m):
            return site
    return None


def save_site_road(site: SiteRoad, path: Path) -> None:
    """Write a site's road as JSON, millimetres as integers."""
    document = {
        "format": FORMAT,
        "version": VERSION,
        "name": site.name,
        "origin_m": site.origin_m.tolist(),
        "provenance": dict(site.provenance),
        "lanes": [_lane_to_dict(lane) for lane in site.road.lanes],
    }
    path.write_text(json.dumps(document, separators=(",", ":"), sort_keys=True) + "\n", encoding="utf-8")


def load_site_road(path: Path) -> SiteRoad:
    """Read what `save_site_road` wrote. InputError where the file is missing or something else."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        if document["format"] != FORMAT or document["version"] > VERSION:
            raise InputError(f"{path} is no {FORMAT} of version {VERSION} or older")
        road = Road(lanes=tuple(_lane_from_dict(lane) for lane in document["lanes"]), source="inferred")
        origin = np.array(document["origin_m"], np.float64)
        return SiteRoad(document["name"], road, origin, document["provenance"])
    except OSError as error:
        raise InputError(
            f"cannot read the road {path}: {error.strerror}; `road` is site, infer, none, or such a file"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is no road of a site: {type(error).__name__}: {error}") from error


def _lane_to_dict(lane: Lane) -> dict[str, Any]:
    assert lane.evidence is not None
    offsets = np.round(lane.evidence.offset_m * 1000)
    return {
        "lane_id": lane.lane_id,
        "centre_line_mm": np.round(lane.centre_line_m * 1000).astype(int).tolist(),
        "successors": list(lane.successors),
        "left_neighbour": lane.left_neighbour,
        "right_neighbour": lane.right_neighbour,
        "in_junction": lane.in_junction,
        "evidence_mm": {
            track: [None if np.isnan(mm) else int(mm) for mm in row]
            for track, row in zip(lane.evidence.track_id, offsets, strict=True)
        },
    }


def _lane_from_dict(lane: Mapping[str, Any]) -> Lane:
    offsets = [[np.nan if mm is None else mm / 1000 for mm in row] for row in lane["evidence_mm"].values()]
    centre = np.array(lane["centre_line_mm"], np.float64) / 1000
    return Lane(
        lane_id=lane["lane_id"],
        centre_line_m=centre.astype(np.float32),
        successors=tuple(lane["successors"]),
        left_neighbour=lane["left_neighbour"],
        right_neighbour=lane["right_neighbour"],
        in_junction=lane["in_junction"],
        evidence=LaneEvidence(
            track_id=tuple(lane["evidence_mm"]),
            offset_m=np.array(offsets, np.float32).reshape(len(offsets), len(centre)),
        ),
    )
