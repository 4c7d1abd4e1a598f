"""Roads as gzipped JSON, named by their content."""

from __future__ import annotations

import gzip
import hashlib
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.corpus.files import write_whole
from stylesim.errors import CorpusError
from stylesim.road import Lane, LaneEvidence, Road

_MAX_BYTES = 1 << 30  # a road larger than this is no road: protects from a zip bomb


def _points(line: np.ndarray | None) -> list[list[float]] | None:
    return None if line is None else np.round(line.astype(np.float64), 3).tolist()


def _number(value: float) -> float | None:
    return None if np.isnan(value) else round(float(value), 6)


def _lane_to_dict(lane: Lane) -> dict[str, Any]:
    evidence = None
    if lane.evidence is not None:
        offsets = [[None if np.isnan(v) else round(float(v), 3) for v in row] for row in lane.evidence.offset_m]
        evidence = {"track_id": list(lane.evidence.track_id), "offset_m": offsets}
    return {
        "lane_id": lane.lane_id,
        "centre_line_m": _points(lane.centre_line_m),
        "width_m": _number(lane.width_m),
        "speed_limit_mps": _number(lane.speed_limit_mps),
        "left_boundary_m": _points(lane.left_boundary_m),
        "right_boundary_m": _points(lane.right_boundary_m),
        "successors": list(lane.successors),
        "left_neighbour": lane.left_neighbour,
        "right_neighbour": lane.right_neighbour,
        "in_junction": lane.in_junction,
        "stop_line_m": _points(lane.stop_line_m),
        "evidence": evidence,
    }


def _lane_from_dict(raw: dict[str, Any]) -> Lane:
    values = dict(raw)
    for name in ("width_m", "speed_limit_mps"):
        values[name] = float("nan") if values[name] is None else float(values[name])
    for name in ("centre_line_m", "left_boundary_m", "right_boundary_m", "stop_line_m"):
        values[name] = None if values[name] is None else np.array(values[name], np.float32)
    values["successors"] = tuple(values["successors"])
    if values["evidence"] is not None:
        offsets = [[np.nan if v is None else v for v in row] for row in values["evidence"]["offset_m"]]
        values["evidence"] = LaneEvidence(tuple(values["evidence"]["track_id"]), np.array(offsets, np.float32))
    return Lane(**values)


def road_to_dict(road: Road) -> dict[str, Any]:
    """The road as JSON values, geometry rounded to 1 mm."""
    walks = [_points(walk) for walk in road.crosswalks_m]
    return {"source": road.source, "lanes": [_lane_to_dict(lane) for lane in road.lanes], "crosswalks_m": walks}


def road_from_dict(raw: dict[str, Any]) -> Road:
    """The inverse of `road_to_dict`; KeyError, TypeError or ValueError if it does not fit."""
    walks = tuple(np.array(walk, np.float32) for walk in raw["crosswalks_m"])
    return Road(tuple(_lane_from_dict(lane) for lane in raw["lanes"]), raw["source"], walks)


def write_road(folder: Path, road: Road) -> str:
    """Write the road under its content's hash unless it is there; returns its name."""
    plain = json.dumps(road_to_dict(road), sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    name = _name(plain)
    path = folder / f"{name}.json.gz"
    if not path.exists():
        write_whole(path, gzip.compress(plain, compresslevel=6, mtime=0))
    return name


def read_road(path: Path) -> Road:
    """The road in that file. CorpusError if it is missing or damaged."""
    plain = _unpacked(path)
    try:
        return road_from_dict(json.loads(plain))
    except (ValueError, KeyError, TypeError) as error:
        raise CorpusError(f"{path} is damaged: {error}") from error


def content_hash(path: Path) -> str:
    """What the name of that file must begin with. CorpusError if it is missing or damaged."""
    return _name(_unpacked(path))


def _name(plain: bytes) -> str:
    return hashlib.sha256(plain).hexdigest()[:20]


def _unpacked(path: Path) -> bytes:
    try:
        with gzip.open(path, "rb") as file:
            plain = file.read(_MAX_BYTES + 1)
    except FileNotFoundError:
        raise CorpusError(f"{path} is missing; the corpus is incomplete") from None
    except (OSError, EOFError, zlib.error) as error:
        raise CorpusError(f"{path} is damaged: {error}") from error
    if len(plain) > _MAX_BYTES:
        raise CorpusError(f"{path} is damaged: it unpacks to more than 1 GiB")
    return plain
