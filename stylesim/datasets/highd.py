"""highD: motorways in Germany by drone, at 25 Hz.

Columns as in the data set's own format page [read]. Positions are of the upper left corner of the box in an image
whose y points down; `width` is along x (the vehicle's length) and `height` across. Here x stays and y is turned, so
that right-hand traffic stays right-hand traffic: the upper carriageway drives towards -x.
Lanes come from the markings' y in the meta data; there is no other map.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.levelx_tables import Triple, classes, first_columns, recording_meta, triples, with_kinds
from stylesim.datasets.resampling import on_clock
from stylesim.datasets.sniffing import header
from stylesim.datasets.tables import csv_table
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError
from stylesim.road import Lane, Road
from stylesim.scene import Scene

SOURCE = "highd"
MAX_LIMIT_MPS = 70.0  # -1 in the files means no limit
MIN_LANE_M, MAX_LANE_M = 2.0, 6.0  # chosen: markings farther apart enclose no lane; motorway lanes are 3.5 to 3.75 m
_NUMBERS = ("frame", "x", "y", "width", "height", "xVelocity", "yVelocity")
_COLUMNS = {"frame", "id", "x", "y", "width", "height", "xVelocity", "laneId"}


def scenes(path: str | Path, *, scene_s: float = SCENE_S) -> Iterator[Scene]:
    """The scenes of every recording in the data folder, by number. Each recording is a unit.

    InputError names the file that is missing, damaged, or in other units.
    """
    for triple in triples(Path(path), "highD"):
        meta = recording_meta(
            triple.recording_meta, ("locationId", "speedLimit"), ("upperLaneMarkings", "lowerLaneMarkings")
        )
        recording_id = f"{SOURCE}_{triple.number}"
        table, source = _tracks(triple, recording_id, 1.0 / meta["frameRate"])
        raw, origin = recording_of(table, source)
        markings = {side: _markings(meta[f"{side}LaneMarkings"], triple.recording_meta) for side in ("upper", "lower")}
        reach = (float(raw.position_m[:, 0].min(initial=0.0)), float(raw.position_m[:, 0].max(initial=1.0)))
        location = meta["locationId"]
        known = location is not None and math.isfinite(location) and abs(location) < 1e6
        yield from cut(
            on_clock(raw),
            source=SOURCE,
            scenario=f"highd_location_{int(location)}" if known else "highd_unknown_site",
            unit_id=recording_id,
            origin_m=origin,
            road=_road(markings, reach, meta["speedLimit"], origin),
            scene_s=scene_s,
        )


def sniff(path: Path) -> bool:
    """True for tracks in highD's columns."""
    return first_columns(path) >= _COLUMNS


def _tracks(triple: Triple, recording_id: str, dt_s: float) -> tuple[pl.DataFrame, Source]:
    raw = csv_table(triple.tracks, {"id": pl.String, **dict.fromkeys(_NUMBERS, pl.Float64)})
    frame = pl.col("frame")
    whole = frame.is_finite().fill_null(False) & (frame.abs() < 1e12) & ((frame - frame.round(0)).abs() < 1e-6)
    table = raw.filter(whole)
    dropped = {"unreadable": raw.height - table.height}
    kinds = classes(triple.tracks_meta, "id")
    if "drivingDirection" in header(triple.tracks_meta):
        kinds = kinds.join(_directions(triple.tracks_meta), on="agent", how="left", maintain_order="left")
    else:
        kinds = kinds.with_columns(direction=pl.lit(None, pl.Int64))
    table = table.select(
        agent="id",
        frame=frame.round(0).cast(pl.Int64) - 1,  # counted from 1 [read]
        x=pl.col("x") + pl.col("width") / 2,
        y=-(pl.col("y") + pl.col("height") / 2),
        vx="xVelocity",
        vy=-pl.col("yVelocity"),
        length="width",
        width="height",
    )
    table = with_kinds(table, kinds, dropped)
    # The boxes are aligned with the image: the heading is the carriageway's. Direction 1 drives towards -x [read].
    towards = pl.when(pl.col("direction").is_null()).then(pl.col("vx") < 0).otherwise(pl.col("direction") == 1)
    table = table.with_columns(heading=pl.when(towards).then(math.pi).otherwise(0.0)).drop("direction")
    return table, Source(triple.tracks, recording_id, dt_s, dropped)


def _directions(file: Path) -> pl.DataFrame:
    table = csv_table(file, {"id": pl.String, "drivingDirection": pl.Int64})
    direction = pl.when(pl.col("drivingDirection").is_in([1, 2])).then("drivingDirection")
    return table.select(agent="id", direction=direction).unique("agent", keep="first", maintain_order=True)


def _markings(text: str | None, file: Path) -> list[float]:
    """The y of each marking (m, downwards, ascending)."""
    try:
        values = [float(part) for part in (text or "").split(";") if part.strip()]
    except ValueError as error:
        raise InputError(f"{file}: lane markings are no numbers separated by semicolons ({text!r:.80})") from error
    if not all(math.isfinite(v) and abs(v) < 1e4 for v in values) or values != sorted(values):
        raise InputError(f"{file}: lane markings must be ascending metres, found {text!r:.80}")
    return values


def _road(
    markings: dict[str, list[float]],
    reach_m: tuple[float, float],
    limit_mps: float | None,
    origin_m: Float64[np.ndarray, " 2"],
) -> Road | None:
    """Straight lanes between the markings, as long as anything was seen; None without markings."""
    limit = limit_mps if limit_mps is not None and 0 < limit_mps < MAX_LIMIT_MPS else math.nan
    lanes = []
    for side, values in markings.items():
        pairs = [(a, b) for a, b in pairwise(values) if MIN_LANE_M <= b - a <= MAX_LANE_M]
        west = side == "upper"  # the upper carriageway drives towards -x
        names = [f"{side}_{k}" for k in range(len(pairs))]
        for k, (top, bottom) in enumerate(pairs):
            left, right = (bottom, top) if west else (top, bottom)
            inner = names[k + 1] if west and k + 1 < len(names) else names[k - 1] if not west and k else ""
            outer = names[k - 1] if west and k else names[k + 1] if not west and k + 1 < len(names) else ""
            lanes.append(
                Lane(
                    lane_id=names[k],
                    centre_line_m=_line(-(top + bottom) / 2, reach_m, west) - origin_m,
                    width_m=bottom - top,
                    speed_limit_mps=limit,
                    left_boundary_m=_line(-left, reach_m, west) - origin_m,
                    right_boundary_m=_line(-right, reach_m, west) - origin_m,
                    left_neighbour=inner,
                    right_neighbour=outer,
                )
            )
    return Road(lanes=tuple(lanes), source="map") if lanes else None


def _line(y_m: float, reach_m: tuple[float, float], west: bool) -> Float64[np.ndarray, "point 2"]:
    x = np.arange(np.floor(reach_m[0]), np.ceil(reach_m[1]) + 10.0, 10.0)
    line = np.stack([x, np.full(len(x), y_m)], axis=1)
    return line[::-1] if west else line
