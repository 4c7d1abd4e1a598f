"""Argoverse 2 motion forecasting: scenarios of 11 s at 10 Hz with a vector map.

A scenario is a folder with `scenario_<id>.parquet` (16 columns, or 18 with `map_id` and `slice_id`) and
`log_map_archive_<id>.json`. One scenario is one scene, never recut; t0 is frame 49, also in the test split, which
has only the first 50 frames. Each scenario is a unit of its own: the format does not say which scenarios come from
one drive (`slice_id` differs from scenario to scenario), so two of them may be neighbours in time; its own split
into train, val and test keeps drives apart and is taken over where the folders are named so.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float64

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.av2_map import read_map
from stylesim.datasets.flagging import flagged_implausible
from stylesim.datasets.sniffing import matching
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag, Tracks

SOURCE = "av2"
DT_S = 0.1
T0_FRAME = 49  # the last of 50 observed frames, by definition of the benchmark
N_FRAMES = 110
SPLITS = ("train", "val", "test")
MAX_SPEED_MPS = 70.0  # chosen, as in `plausible`: 252 km/h

KINDS = {
    "vehicle": AgentKind.CAR,
    "bus": AgentKind.BUS,
    "motorcyclist": AgentKind.MOTORCYCLE,
    "cyclist": AgentKind.BICYCLE,
    "pedestrian": AgentKind.PEDESTRIAN,
    "static": AgentKind.STATIC,
    "construction": AgentKind.STATIC,
    "riderless_bicycle": AgentKind.STATIC,
    "background": AgentKind.OTHER,
    "unknown": AgentKind.OTHER,
}
# The format gives no sizes. Chosen: common sizes of each kind (a mid-size car, a 12 m bus, a rider, a person), so
# that bumper-to-bumper gaps are right on average.
NOMINAL_SIZE_M = {
    AgentKind.CAR: (4.6, 1.9),
    AgentKind.BUS: (12.0, 2.55),
    AgentKind.MOTORCYCLE: (2.2, 0.8),
    AgentKind.BICYCLE: (1.8, 0.6),
    AgentKind.PEDESTRIAN: (0.6, 0.6),
    AgentKind.STATIC: (1.0, 1.0),
    AgentKind.OTHER: (1.0, 1.0),
}
_NUMBERS = ("position_x", "position_y", "heading", "velocity_x", "velocity_y")
_COLUMNS: dict[str, Any] = {
    "track_id": pl.String,
    "object_type": pl.String,
    "timestep": pl.Int64,
    **dict.fromkeys(_NUMBERS, pl.Float64),
    "scenario_id": pl.String,
    "focal_track_id": pl.String,
    "city": pl.String,
}


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenarios of a scenario's folder, of a split, or of a root with train/val/test; by split, then id.

    InputError where there is none, or a file is missing or damaged; it names the file.
    """
    root = Path(path)
    if not root.is_dir():
        raise InputError(f"{root} is no folder; give a scenario's folder, a split, or the root of the data set")
    found = False
    for folder, split in _folders(root):
        found = True
        yield _scene(folder, split)
    if not found:
        raise InputError(f"{root} holds no Argoverse 2 scenario (a folder with scenario_<id>.parquet)")


def sniff(path: Path) -> bool:
    """True for a scenario's folder, a split, or a root with splits."""
    name = "scenario_*.parquet"
    return path.is_dir() and bool(matching(path, name, f"*/{name}", f"*/*/{name}"))


def _folders(root: Path) -> Iterator[tuple[Path, str]]:
    """Folders of scenarios in a fixed order, each with its official split ("" where the names do not say)."""
    if _parquet(root) is not None:
        yield root, root.parent.name if root.parent.name in SPLITS else ""
        return
    splits = [root / name for name in SPLITS if (root / name).is_dir()]
    for parent in splits or [root]:
        split = parent.name if parent.name in SPLITS else ""
        for folder in sorted(p for p in parent.iterdir() if p.is_dir()):
            if _parquet(folder) is None:
                raise InputError(f"{folder} has no scenario_*.parquet; the copy is incomplete, or it is something else")
            yield folder, split


def _parquet(folder: Path) -> Path | None:
    files = sorted(folder.glob("scenario_*.parquet"))
    if len(files) > 1:
        raise InputError(f"{folder} holds {len(files)} scenario_*.parquet; a scenario's folder has one")
    return files[0] if files else None


def _scene(folder: Path, split: str) -> Scene:
    file = _parquet(folder)
    assert file is not None
    raw = _read(file)
    table, dropped = _clean(raw, file)
    scenario_id = str(table["scenario_id"][0])
    xy = table.select("position_x", "position_y").to_numpy()
    first = xy[table["timestep"].to_numpy() == table["timestep"].min()]
    origin = np.round(first.mean(axis=0))  # of the first frame only: what comes later moves nothing
    observed = int(table["timestep"].max()) + 1  # type: ignore[arg-type]
    maps = sorted(folder.glob("log_map_archive_*.json"))
    if not maps:
        raise InputError(f"{folder} has no log_map_archive_*.json beside {file.name}; the copy is incomplete")
    return Scene(
        scene_id=f"av2_{scenario_id}",
        unit_id=f"av2_{scenario_id}",
        source=SOURCE,
        scenario=str(table["city"][0]),
        tracks=flagged_implausible(_tracks(table, origin, T0_FRAME + 1 if observed <= T0_FRAME + 1 else N_FRAMES)),
        road=read_map(maps[0], origin),
        source_scenario_id=scenario_id,
        official_split=split,
        t0_frame=T0_FRAME,
        counts=row_counts(rows_in=raw.height, rows_out=table.height, dropped=dropped),
    )


def _read(file: Path) -> pl.DataFrame:
    try:
        table = pl.read_parquet(file)
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = (str(error).splitlines() or ["unreadable"])[0]
        raise InputError(f"{file} is damaged or no Parquet file ({reason}); get it again") from error
    absent = [name for name in _COLUMNS if name not in table.columns]
    if absent:
        raise InputError(f"{file} lacks the columns {', '.join(absent)}; it is no scenario of Argoverse 2")
    try:
        return table.select(pl.col(name).cast(dtype) for name, dtype in _COLUMNS.items())
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{file} has a column of the wrong type ({str(error).splitlines()[0]})") from error


def _clean(table: pl.DataFrame, file: Path) -> tuple[pl.DataFrame, dict[str, int]]:
    """The usable rows sorted by track and time, and how many were dropped for which reason."""
    for name in ("scenario_id", "city", "focal_track_id"):
        if table[name].n_unique() > 1:
            raise InputError(f"{file} holds {table[name].n_unique()} values of {name}; a scenario has one")
    numbers = [pl.col(name).is_finite().fill_null(False) for name in _NUMBERS]
    ids = [pl.col(name).is_not_null() for name in ("track_id", "object_type", "timestep", "scenario_id")]
    readable = table.filter(pl.all_horizontal(*numbers, *ids))
    speed2 = pl.col("velocity_x").pow(2) + pl.col("velocity_y").pow(2)
    plausible = readable.filter(pl.col("timestep").is_between(0, N_FRAMES - 1) & (speed2 <= MAX_SPEED_MPS**2))
    once = plausible.unique(["track_id", "timestep"], keep="first", maintain_order=True).sort("track_id", "timestep")
    if once.is_empty():
        raise InputError(f"{file} has no usable row")
    lost = {
        "unreadable": table.height - readable.height,
        "implausible": readable.height - plausible.height,
        "duplicate": plausible.height - once.height,
    }
    return once, lost


def _tracks(table: pl.DataFrame, origin_m: Float64[np.ndarray, " 2"], n_frames: int) -> Tracks:
    ids, agent = np.unique(table["track_id"].to_numpy(), return_inverse=True)
    frame = table["timestep"].to_numpy()
    first = np.searchsorted(agent, np.arange(len(ids)))
    kind = np.array([int(KINDS.get(table["object_type"][int(i)], AgentKind.OTHER)) for i in first], np.int8)
    at = (agent, frame)
    shape = (len(ids), n_frames)
    valid = np.zeros(shape, bool)
    valid[at] = True
    position, velocity = np.full((*shape, 2), np.nan, np.float32), np.full((*shape, 2), np.nan, np.float32)
    heading = np.full(shape, np.nan, np.float32)
    position[at] = table.select("position_x", "position_y").to_numpy() - origin_m
    velocity[at] = table.select("velocity_x", "velocity_y").to_numpy()
    heading[at] = wrap_angle(table["heading"].to_numpy())
    return Tracks(
        agent_id=tuple(str(i) for i in ids),
        kind=kind,
        size_m=np.array([NOMINAL_SIZE_M[AgentKind(k)] for k in kind.tolist()], np.float32),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=DT_S,
        origin_m=origin_m,
        flags=np.array([_flags(str(i), table["focal_track_id"][0]) for i in ids], np.int32),
    )


def _flags(track_id: str, focal_track_id: str | None) -> int:
    flag = int(TrackFlag.FOCAL) if track_id == focal_track_id else 0
    return flag | (int(TrackFlag.EGO) if track_id == "AV" else 0)
