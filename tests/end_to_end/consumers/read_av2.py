"""Run by an environment that has `av2`: prints as JSON what it reads of an export."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path

from av2.datasets.motion_forecasting.scenario_serialization import load_argoverse_scenario_parquet
from av2.map.map_api import ArgoverseStaticMap


def scene(file: Path) -> dict[str, object]:
    found = load_argoverse_scenario_parquet(file)
    road = ArgoverseStaticMap.from_json(file.parent / f"log_map_archive_{found.scenario_id}.json")
    agents = {
        track.track_id: {
            "frames": [state.timestep for state in track.object_states],
            "position": [state.position for state in track.object_states],
            "heading": [state.heading for state in track.object_states],
            "velocity": [state.velocity for state in track.object_states],
        }
        for track in found.tracks
    }
    lanes = {str(n): road.get_lane_segment_centerline(n)[:, :2].tolist() for n in road.get_scenario_lane_segment_ids()}
    return {"agents": agents, "lanes": lanes, "focal": found.focal_track_id}


def main() -> None:
    files = sorted(Path(sys.argv[1]).rglob("scenario_*.parquet"))
    json.dump({"version": version("av2"), "scenes": {file.parent.name: scene(file) for file in files}}, sys.stdout)


main()
