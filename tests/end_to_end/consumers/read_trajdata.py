"""Run by an environment that has `trajdata[waymo]`: prints as JSON what it reads of a `womd` export."""

from __future__ import annotations

import contextlib
import json
import shutil
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

ENV = "waymo_train"


def scenes(export: Path, folder: Path) -> dict[str, object]:
    from trajdata import MapAPI, UnifiedDataset
    from trajdata.caching.df_cache import DataFrameCache

    (folder / "raw" / "training").mkdir(parents=True)
    for file in export.glob("*tfrecord*"):
        shutil.copy(file, folder / "raw" / "training")
    data = UnifiedDataset(
        desired_data=[ENV], data_dirs={ENV: str(folder / "raw")}, cache_location=str(folder / "cache"),
        incl_vector_map=True, num_workers=0, verbose=False,
    )  # fmt: skip
    maps, found = MapAPI(folder / "cache"), {}
    for scene in data.scenes():
        cache = DataFrameCache(folder / "cache", scene)
        agents = {}
        for name, rows in cache.scene_data_df.groupby(level="agent_id"):
            agents[name] = {
                "frames": rows.index.get_level_values("scene_ts").tolist(),
                "position": rows[["x", "y"]].to_numpy().tolist(),
                "heading": rows["heading"].tolist(),
                "velocity": rows[["vx", "vy"]].to_numpy().tolist(),
                "size": rows[["length", "width"]].iloc[0].tolist(),
            }
        lanes = {lane.id: lane.center.xy.tolist() for lane in maps.get_map(f"{ENV}:{scene.location}").lanes}
        lights: dict[str, dict[int, str]] = {}
        for (lane_id, t), status in cache.get_traffic_light_status_dict().items():
            lights.setdefault(str(lane_id), {})[int(t)] = status.name
        lights_by_frame = {lane: [states[t] for t in sorted(states)] for lane, states in lights.items()}
        found[scene.name] = {"agents": agents, "lanes": lanes, "lights": lights_by_frame}
    return found


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(sys.stderr):  # the package prints
        result = scenes(Path(sys.argv[1]), Path(folder))
    json.dump({"version": version("trajdata"), "scenes": result}, sys.stdout)


main()
