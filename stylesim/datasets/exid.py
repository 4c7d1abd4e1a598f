"""exiD: motorway entries and exits in Germany by drone; see `levelx`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stylesim.datasets.cutting import SCENE_S
from stylesim.datasets.levelx import COLUMNS, LANE_COLUMNS, recording_scenes
from stylesim.datasets.levelx_tables import first_columns
from stylesim.scene import Scene

SOURCE = "exid"


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of every recording in the data folder, by number; see `levelx.recording_scenes`."""
    yield from recording_scenes(SOURCE, "exiD", Path(path), scene_s=scene_s, map=map)


def sniff(path: Path) -> bool:
    """True for tracks in levelXData's columns with those about lanes."""
    columns = first_columns(path)
    return {*COLUMNS, *LANE_COLUMNS} <= columns
