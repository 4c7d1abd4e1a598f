"""Run by an environment that has `metadrive-simulator`: prints as JSON what it reads of an export, checked by it."""

from __future__ import annotations

import contextlib
import json
import pickle
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np


def scene(file: Path) -> dict[str, object]:
    from metadrive.scenario.scenario_description import ScenarioDescription
    from metadrive.scenario.utils import read_scenario_data

    plain = pickle.loads(file.read_bytes())
    ScenarioDescription.sanity_check(plain, check_self_type=True, valid_check=True)
    found = read_scenario_data(str(file))
    agents = {}
    for name, track in found["tracks"].items():
        state, frames = track["state"], np.flatnonzero(track["state"]["valid"])
        agents[name] = {
            "frames": frames.tolist(),
            "position": state["position"][frames, :2].tolist(),
            "heading": state["heading"][frames].tolist(),
            "velocity": state["velocity"][frames].tolist(),
            "size": [float(state["length"][frames[0]]), float(state["width"][frames[0]])],
        }
    lanes = {
        name: np.asarray(feature["polyline"])[:, :2].tolist()
        for name, feature in found["map_features"].items()
        if feature["type"].startswith("LANE")
    }
    lights = {light["lane"]: light["state"]["object_state"] for light in found["dynamic_map_states"].values()}
    return {"agents": agents, "lanes": lanes, "lights": lights, "sdc": found["metadata"]["sdc_id"]}


def main() -> None:
    with contextlib.redirect_stdout(sys.stderr):  # the package prints
        from metadrive.scenario.utils import read_dataset_summary

        folder = Path(sys.argv[1])
        summary, names, mapping = read_dataset_summary(str(folder), check_file_existence=True)
        scenes = {summary[name]["id"]: scene(folder / mapping[name] / name) for name in names}
    json.dump({"version": version("metadrive-simulator"), "scenes": scenes}, sys.stdout)


main()
