"""Folders laid out as those of INTERACTION, which TAF-BW follows: sites, numbered recordings, maps."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from stylesim.datasets.sniffing import header
from stylesim.errors import InputError

TRACKS = ("vehicle_tracks_*.csv", "*/vehicle_tracks_*.csv", "*/*/vehicle_tracks_*.csv")
_NAME = re.compile(r"^(vehicle|pedestrian)_tracks_(\w+)\.csv(\.gz)?$")


def looks_like(path: Path) -> bool:
    """True for a file with these columns."""
    return {"track_id", "timestamp_ms", "agent_type", "vx", "psi_rad"} <= set(header(path))


def recordings_in(folder: Path) -> dict[str, list[Path]]:
    """The track files of a folder by the number in their names, vehicles first."""
    found: dict[str, list[Path]] = {}
    for file in sorted(folder.iterdir(), reverse=True):
        match = _NAME.match(file.name)
        if match:
            found.setdefault(match.group(2), []).append(file)
    return dict(sorted(found.items()))


def sites(root: Path) -> Iterator[tuple[Path, dict[str, list[Path]]]]:
    """Folders with track files, each with its recordings."""
    if root.is_file():
        yield root.parent, {root.stem.split("_")[-1]: [root]}
        return
    if not root.is_dir():
        raise InputError(f"{root} does not exist; give a site's folder, or the root of the data set")
    folders = {file.parent for pattern in TRACKS for file in root.glob(pattern)}
    for folder in sorted(folders):
        yield folder, recordings_in(folder)


def site_of(folder: Path, given: str) -> tuple[str, Path | None]:
    """Name and map of the site of a folder; None where no map is found."""
    if given == "none":
        return folder.name, None
    if given:
        return Path(given).stem, Path(given)
    here = sorted(folder.glob("*.osm"))
    if len(here) > 1:
        raise InputError(f"{folder} holds {len(here)} maps (*.osm); say which with the option map=FILE")
    if here:
        return here[0].stem, here[0]
    for maps in (folder.parent / "maps", folder.parent.parent / "maps"):
        if (maps / f"{folder.name}.osm").is_file():
            return folder.name, maps / f"{folder.name}.osm"
    return folder.name, None
