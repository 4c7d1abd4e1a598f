"""Scenarios in the format of Argoverse 2 motion forecasting, written by the tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from tests.formats.mutations import mutated_frame

ID = "0a0a0000-0000-0000-0000-000000000001"


def table(*, scenario_id: str = ID, n_frames: int = 110, columns: int = 16) -> pl.DataFrame:
    """A focal vehicle, the AV, a pedestrian and a bus that is seen from frame 20 on."""
    rows: list[dict[str, Any]] = []
    who = (("89320", "vehicle", 3, 0), ("AV", "vehicle", 1, 0), ("7", "pedestrian", 0, 0), ("8", "bus", 0, 20))
    for i, (track, kind, category, first) in enumerate(who):
        for t in range(first, n_frames):
            rows.append(
                {
                    "observed": t < 50, "track_id": track, "object_type": kind, "object_category": category,
                    "timestep": t, "position_x": 1900.0 + t, "position_y": 600.0 + 4.0 * i, "heading": 0.0,
                    "velocity_x": 10.0, "velocity_y": 0.0, "scenario_id": scenario_id,
                    "start_timestamp": 3.1e17, "end_timestamp": 3.1e17, "num_timestamps": n_frames,
                    "focal_track_id": "89320", "city": "pittsburgh",
                }
            )  # fmt: skip
    frame = pl.DataFrame(rows)
    if columns == 18:
        frame = frame.with_columns(map_id=pl.lit(74806, pl.UInt64), slice_id=pl.lit("7bef7e1f"))
    return frame


def _line(*points: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": 9.5} for x, y in points]


def vector_map() -> dict[str, Any]:
    """Two lanes, one after the other, a bicycle lane beside them, a crosswalk; one successor is off the map."""

    def lane(i: int, x: float, kind: str, successors: list[int], **more: Any) -> dict[str, Any]:
        return {
            "id": i, "lane_type": kind, "is_intersection": i == 2, "successors": successors, "predecessors": [],
            "left_neighbor_id": 3 if i == 1 else None, "right_neighbor_id": 99,
            "left_lane_boundary": _line((x, 602.0), (x + 50, 602.0)),
            "right_lane_boundary": _line((x, 598.0), (x + 30, 598.0), (x + 50, 598.0)), **more,
        }  # fmt: skip

    lanes = [lane(1, 1900, "VEHICLE", [2]), lane(2, 1950, "BUS", [99]), lane(3, 1900, "VEHICLE", [])]
    lanes[2]["centerline"] = _line((1900, 605.0), (1925, 605.5), (1950, 605.0))
    lanes.append(lane(4, 1900, "BIKE", []))
    crossing = {"id": 5, "edge1": _line((1960, 590), (1960, 610)), "edge2": _line((1964, 590), (1964, 610))}
    return {
        "drivable_areas": {},
        "lane_segments": {str(segment["id"]): segment for segment in lanes},
        "pedestrian_crossings": {"5": crossing},
    }


def write(parent: Path, *, scenario_id: str = ID, frame: pl.DataFrame | None = None, **options: Any) -> Path:
    """A scenario's folder in `parent`."""
    folder = parent / scenario_id
    folder.mkdir(parents=True)
    frame = table(scenario_id=scenario_id, **options) if frame is None else frame
    frame.write_parquet(folder / f"scenario_{scenario_id}.parquet")
    (folder / f"log_map_archive_{scenario_id}.json").write_text(json.dumps(vector_map()))
    return folder


def sample(folder: Path) -> Path:
    """Two scenarios of the training split."""
    for name in ("a", "b"):
        write(folder / "train", scenario_id=name)
    return folder


def mutate(folder: Path, rng: np.random.Generator) -> None:
    """Damage the values of one table."""
    file = sorted(folder.rglob("*.parquet"))[0]
    mutated_frame(pl.read_parquet(file), rng).write_parquet(file)
