"""inD: intersections in Germany by drone; see `levelx`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stylesim.datasets.cutting import SCENE_S
from stylesim.datasets.levelx import COLUMNS, LANE_COLUMNS, recording_scenes
from stylesim.datasets.levelx_tables import ROUND, first_classes, first_columns
from stylesim.scene import Scene

SOURCE = "ind"


def scenes(path: str | Path, *, scene_s: float = SCENE_S, map: str = "") -> Iterator[Scene]:
    """The scenes of every recording in the data folder, by number; see `levelx.recording_scenes`."""
    yield from recording_scenes(SOURCE, "inD", Path(path), scene_s=scene_s, map=map)


def sniff(path: Path) -> bool:
    """True for tracks in levelXData's columns without the classes that only rounD has."""
    columns = first_columns(path)
    return set(COLUMNS) <= columns and not set(LANE_COLUMNS) & columns and not first_classes(path) & ROUND
