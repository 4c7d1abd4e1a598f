"""What a vector map of Argoverse 2 holds, parsed into records of their own: half the time of a general parser.

Only what is read here is kept; drivable areas, two fifths of a file, are passed over.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from stylesim.datasets.guarding import bounded

MAX_FILE_BYTES = 1 << 28  # chosen: maps have 0.1 to 10 MB


class Point(msgspec.Struct, gc=False):
    """A place in metres, in the city's frame."""

    x: float
    y: float


class LaneSegment(msgspec.Struct, gc=False):
    """One lane segment as the file has it."""

    id: int | str
    lane_type: str
    is_intersection: bool
    left_lane_boundary: list[Point]
    right_lane_boundary: list[Point]
    successors: list[int | str]
    left_neighbor_id: int | str | None
    right_neighbor_id: int | str | None
    centerline: list[Point] | None = None  # in sensor logs it is not there


class Crossing(msgspec.Struct, gc=False):
    """A pedestrian crossing between two edges."""

    edge1: list[Point]
    edge2: list[Point]


class MapFile(msgspec.Struct, gc=False):
    """The content of `log_map_archive_<id>.json`."""

    lane_segments: dict[str, LaneSegment]
    pedestrian_crossings: dict[str, Crossing] = {}  # a Struct copies it


_DECODER = msgspec.json.Decoder(MapFile)


def map_file(path: Path) -> MapFile:
    """The content of a map file. InputError where it is missing or too large, ValueError where it is no such map."""
    raw = bounded(path, MAX_FILE_BYTES).read_bytes()
    try:
        return _DECODER.decode(raw)
    except msgspec.MsgspecError as error:
        raise ValueError(str(error)) from error
