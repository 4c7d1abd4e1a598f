"""Argoverse 2 motion forecasting: scenarios of 11 s at 10 Hz with a vector map.

A scenario is a folder with `scenario_<id>.parquet` (16 columns, or 18 with `map_id` and `slice_id`) and
`log_map_archive_<id>.json`. One scenario is one scene, never recut; t0 is frame 49, also in the test split, which
has only the first 50 frames. Each scenario is a unit of its own: the format does not say which scenarios come from
one drive (`slice_id` differs from scenario to scenario), so two of them may be neighbours in time; its own split
into train, val and test keeps drives apart and is taken over where the folders are named so.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.accounting import row_counts
from stylesim.datasets.av2_map import read_map
from stylesim.datasets.av2_tables import N_FRAMES, AvTable, table_of
from stylesim.datasets.dense import refuse_other_units
from stylesim.datasets.flagging import flagged_implausible
from stylesim.datasets.sizes import nominal_sizes
from stylesim.datasets.sniffing import matching
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, TrackFlag, Tracks

SOURCE = "av2"
DT_S = 0.1
T0_FRAME = 49  # the last of 50 observed frames, by definition of the benchmark
SPLITS = ("train", "val", "test")

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


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenarios of a scenario's folder, of a split, or of a root with train/val/test; by split, then id.

    InputError where there is none, or a file is missing or damaged; it names the file.
    """
    for folder in files(path):
        yield _scene(folder, folder.parent.name if folder.parent.name in SPLITS else "")


def files(path: str | Path) -> Iterator[Path]:
    """The scenarios' folders, each of which can be read alone; InputError as for `scenes`."""
    root = Path(path)
    if not root.is_dir():
        raise InputError(f"{root} is no folder; give a scenario's folder, a split, or the root of the data set")
    found = _folders(root)
    first = next(found, None)
    if first is None:
        raise InputError(f"{root} holds no Argoverse 2 scenario (a folder with scenario_<id>.parquet)")
    return chain([first], found)


def sniff(path: Path) -> bool:
    """True for a scenario's folder, a split, or a root with splits."""
    name = "scenario_*.parquet"
    return path.is_dir() and bool(matching(path, name, f"*/{name}", f"*/*/{name}"))


def _folders(root: Path) -> Iterator[Path]:
    """Folders of scenarios in a fixed order."""
    if _parquet(root) is not None:
        yield root
        return
    splits = [root / name for name in SPLITS if (root / name).is_dir()]
    for parent in splits or [root]:
        with os.scandir(parent) as entries:
            names = sorted(entry.name for entry in entries if entry.is_dir())
        for folder in (parent / name for name in names):
            if _parquet(folder) is None:
                raise InputError(f"{folder} has no scenario_*.parquet; the copy is incomplete, or it is something else")
            yield folder


def _named(folder: Path, begin: str, end: str) -> list[Path]:
    """The files of a folder by name; a pattern of `glob` costs ten times as much, thrice for each of a million."""
    try:
        with os.scandir(folder) as entries:
            names = sorted(e.name for e in entries if e.name.startswith(begin) and e.name.endswith(end))
    except OSError as error:
        raise InputError(f"cannot read {folder}: {error.strerror or error}") from error
    return [folder / name for name in names]


def _parquet(folder: Path) -> Path | None:
    files = _named(folder, "scenario_", ".parquet")
    if len(files) > 1:
        raise InputError(f"{folder} holds {len(files)} scenario_*.parquet; a scenario's folder has one")
    return files[0] if files else None


def _scene(folder: Path, split: str) -> Scene:
    file = _parquet(folder)
    assert file is not None
    table = table_of(file)
    first = table.numbers[table.frame == table.frame.min(), :2]
    origin = np.round(np.median(first, axis=0))  # of the first frame only: what comes later moves nothing
    observed = int(table.frame.max()) + 1
    maps = _named(folder, "log_map_archive_", ".json")
    if not maps:
        raise InputError(f"{folder} has no log_map_archive_*.json beside {file.name}; the copy is incomplete")
    tracks = flagged_implausible(_tracks(table, origin, T0_FRAME + 1 if observed <= T0_FRAME + 1 else N_FRAMES))
    refuse_other_units(tracks, file)
    return Scene(
        scene_id=f"av2_{table.scenario_id}",
        unit_id=f"av2_{table.scenario_id}",
        source=SOURCE,
        scenario=table.city,
        tracks=tracks,
        road=read_map(maps[0], origin),
        source_scenario_id=table.scenario_id,
        official_split=split,
        t0_frame=T0_FRAME,
        counts=row_counts(rows_in=table.rows_in, rows_out=len(table.frame), dropped=table.dropped),
    )


def _tracks(table: AvTable, origin_m: Float64[np.ndarray, " 2"], n_frames: int) -> Tracks:
    kind = np.array([int(KINDS.get(name, AgentKind.OTHER)) for name in table.object_type], np.int8)
    at = (table.agent, table.frame)
    shape = (len(table.agent_id), n_frames)
    valid = np.zeros(shape, bool)
    valid[at] = True
    position, velocity = np.full((*shape, 2), np.nan, np.float32), np.full((*shape, 2), np.nan, np.float32)
    heading = np.full(shape, np.nan, np.float32)
    position[at], velocity[at] = table.numbers[:, 0:2] - origin_m, table.numbers[:, 3:5]
    heading[at] = wrap_angle(table.numbers[:, 2])
    return Tracks(
        agent_id=table.agent_id,
        kind=kind,
        size_m=nominal_sizes(kind),  # the format gives none
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=valid,
        dt_s=DT_S,
        origin_m=origin_m,
        flags=np.array([_flags(name, table.focal_track_id) for name in table.agent_id], np.int32),
    )


def _flags(track_id: str, focal_track_id: str) -> int:
    flag = int(TrackFlag.FOCAL) if track_id == focal_track_id else 0
    return flag | (int(TrackFlag.EGO) if track_id == "AV" else 0)
