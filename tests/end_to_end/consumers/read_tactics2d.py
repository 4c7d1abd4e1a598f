"""Run by an environment that has `tactics2d`: prints as JSON what it reads of a `levelx` export, taken for inD."""

from __future__ import annotations

import contextlib
import json
import sys
import warnings
from importlib.metadata import version
from pathlib import Path

STAMP_MS = 40  # the package takes every recording of inD for 25 Hz, whatever its meta data say


def recording(number: int, folder: Path) -> dict[str, object]:
    from tactics2d.dataset_parser import LevelXParser

    found, agents = LevelXParser("inD").parse_trajectory(number, str(folder))[0], {}
    for name, participant in found.items():
        states = [participant.trajectory.get_state(stamp) for stamp in participant.trajectory.frames]
        agents[str(name)] = {
            "frames": [int(stamp) // STAMP_MS for stamp in participant.trajectory.frames],
            "position": [[state.x, state.y] for state in states],
            "heading": [state.heading for state in states],
            "velocity": [[state.vx, state.vy] for state in states],
            "size": [participant.length, participant.width],
        }
    return {"agents": agents}


def main() -> None:
    folder = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    with contextlib.redirect_stdout(sys.stderr):
        numbers = [int(file.name.split("_")[0]) for file in sorted(folder.glob("*_tracks.csv"))]
        scenes = {str(number): recording(number, folder) for number in numbers}
    json.dump({"version": version("tactics2d"), "scenes": scenes}, sys.stdout)


main()
