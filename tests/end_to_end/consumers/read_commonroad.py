"""Run by an environment that has `commonroad-io`: prints as JSON what it reads of an export."""

from __future__ import annotations

import contextlib
import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader


def scene(file: Path) -> dict[str, object]:
    found, _ = CommonRoadFileReader(str(file)).open()
    agents = {}
    for obstacle in found.dynamic_obstacles:
        states = [obstacle.initial_state, *obstacle.prediction.trajectory.state_list]
        agents[str(obstacle.obstacle_id)] = {
            "frames": [state.time_step for state in states],
            "position": [state.position.tolist() for state in states],
            "heading": [state.orientation for state in states],
            "speed": [state.velocity for state in states],
            "size": [obstacle.obstacle_shape.length, obstacle.obstacle_shape.width],
        }
    network, lights = found.lanelet_network, {}
    frames = 1 + max(agent["frames"][-1] for agent in agents.values())
    for lanelet in network.lanelets:
        for number in lanelet.traffic_lights:
            light = network.find_traffic_light_by_id(number)
            lights[str(lanelet.lanelet_id)] = [light.get_state_at_time_step(t).name for t in range(frames)]
    lanes = {str(lanelet.lanelet_id): np.asarray(lanelet.center_vertices).tolist() for lanelet in network.lanelets}
    return {"agents": agents, "lanes": lanes, "lights": lights}


def main() -> None:
    with contextlib.redirect_stdout(sys.stderr):  # the reader prints
        scenes = {file.stem: scene(file) for file in sorted(Path(sys.argv[1]).glob("*.xml"))}
    json.dump({"version": version("commonroad-io"), "scenes": scenes}, sys.stdout)


main()
