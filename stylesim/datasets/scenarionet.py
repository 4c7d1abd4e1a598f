"""ScenarioNet pickles: scenarios of nuScenes, Waymo, nuPlan, Argoverse and others in MetaDrive's description.

One pickle is one scene, never recut. Every generation whose tracks hold arrays by name is read, with light states as
names or numbers; the older form, in which a track's state is one array, is refused. Pickles are never run (see
`safe_pickle`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from stylesim.collecting import no_collection
from stylesim.datasets import safe_pickle
from stylesim.datasets.accounting import row_counts
from stylesim.datasets.dense import checked_tracks
from stylesim.datasets.guarding import bounded, mapping, reading
from stylesim.datasets.polyline_map import road_of
from stylesim.datasets.scenarionet_map import map_of, signals_of
from stylesim.datasets.scenarionet_tracks import DT_S, tracks_of, units_of
from stylesim.datasets.sniffing import head, listed, matching
from stylesim.errors import InputError
from stylesim.scene import Scene

SOURCE = "scenarionet"
MAX_FILE_BYTES = 1 << 30  # chosen: scenarios have 1 to 20 MB
_NOT_SCENARIOS = ("dataset_summary.pkl", "dataset_mapping.pkl")
_MARKS = (b"dynamic_map_states", b"map_features", b"tracks")


def scenes(path: str | Path) -> Iterator[Scene]:
    """The scenarios of a pickle, or of every one in a database's folder (and its parts), by name.

    InputError names the file that is damaged, hostile, or of a form that is not read.
    """
    for file in files(path):
        bounded(file, MAX_FILE_BYTES)
        with reading(file, "scenario of ScenarioNet"):
            with no_collection():
                document = safe_pickle.loads(file.read_bytes())
            scene = _scene(mapping(document, "the document"), file)
        yield scene


def files(path: str | Path) -> list[Path]:
    """The scenarios' pickles, each of which can be read alone; InputError where there is none."""
    found = _files(Path(path), listed)
    if not found:
        raise InputError(f"{path} holds no scenario of ScenarioNet (*.pkl)")
    return found


def sniff(path: Path) -> bool:
    """True for a pickle in which the words of a scenario stand, or a folder with one."""
    found = _files(path, matching)
    if not found or head(found[0], 1) != b"\x80":
        return False
    start = head(found[0], 1 << 26)
    return all(mark in start for mark in _MARKS)


def _files(path: Path, find: Callable[..., list[Path]]) -> list[Path]:
    found = [path] if path.is_file() else find(path, "*.pkl", "*/*.pkl", "*/*/*.pkl")
    return [file for file in found if file.suffix == ".pkl" and file.name not in _NOT_SCENARIOS]


def _scene(document: Mapping[str, Any], file: Path) -> Scene:
    meta = mapping(document["metadata"], "metadata")
    scenario_id = str(document.get("id") or meta.get("scenario_id") or file.stem)
    dataset = str(meta.get("dataset") or "unknown")
    read = tracks_of(document, file)
    tracks, dropped = checked_tracks(**read.arrays, dt_s=DT_S, file=file)
    features = map_of(mapping(document.get("map_features") or {}, "map_features"), limits=dataset != "nuscenes")
    lights = mapping(document.get("dynamic_map_states") or {}, "dynamic_map_states")
    signals = signals_of(lights, tracks.n_frames, features)
    linked = any(lane.successors for lane in features.lanes)
    t0 = meta.get("current_time_index")
    return Scene(
        scene_id=f"scenarionet_{dataset}_{scenario_id}",
        unit_id=units_of(meta, dataset, scenario_id),
        source=SOURCE,
        scenario=str(meta.get("map") or dataset),
        tracks=tracks,
        road=road_of(features, tracks.origin_m, link_ends=not linked) if features.lanes else None,
        signals=signals,
        source_scenario_id=scenario_id,
        t0_frame=int(t0) if t0 is not None and 0 <= int(t0) < tracks.n_frames else None,
        counts=row_counts(rows_in=read.rows, rows_out=int(tracks.valid.sum()), dropped={**read.dropped, **dropped}),
    )
