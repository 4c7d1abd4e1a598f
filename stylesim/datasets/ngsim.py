"""NGSIM: vehicles on US-101, I-80, Lankershim and Peachtree, from cameras on buildings, at 10 Hz and in feet.

The portal's one CSV holds all sites; the original files hold one site and period each. A unit is a site and a period:
rows of one period share `Global_Time - 100 * Frame_ID` (the portal has lost the leading digits of its times, so that
periods overlap in `Global_Time` alone). Positions are of the middle of the front and are moved to the centre.

Known defects, and what is done: rows that are there twice and rows whose time and frame disagree are dropped and
counted; an identifier that goes on with another size, or after IDENTITY_GAP_S, is another vehicle ("352/2"); the
direction comes from positions, the speed is the file's own; tracks that jump or contradict their speed are kept and
flagged implausible, never smoothed here: smoothing over a whole track would know its future, and the labellers smooth
every source alike, window by window.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import polars as pl

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.ngsim_tables import FRAMES, has_header, is_original, site_tables
from stylesim.datasets.sniffing import matching
from stylesim.datasets.track_table import Source, recording_of
from stylesim.errors import InputError, unknown
from stylesim.scene import Scene

SOURCE = "ngsim"
DT_S = 0.1
STEP_MS = 100.0
MIN_PERIOD_SHARE = 0.001  # chosen: fewer rows than this of a site that share an offset are damaged, no period
IDENTITY_GAP_S = 10.0  # chosen: a vehicle that is not seen for so long has left; identifiers are used again
MAX_WALL_MS = 1e15  # a larger time is damaged


def scenes(path: str | Path, *, scene_s: float = SCENE_S, frame: str = "global") -> Iterator[Scene]:
    """The scenes of a file, or of every file of a folder, by site and period, in time.

    `frame`: "global" (state plane, x east) or "local" (the site's own: x across, y along the road). InputError names
    the file that is missing, damaged, or in other units.
    """
    if frame not in FRAMES:
        raise unknown("frame", frame, FRAMES)
    for file in _files(Path(path)):
        found = False
        for site, table in site_tables(file, frame):
            name = "".join(c if c.isalnum() or c == "-" else "_" for c in site)[:60] or "unknown_site"
            for period, part, dropped in _periods(table):
                found = True
                recording_id = f"{SOURCE}_{name}_{period}"
                source = Source(file, recording_id, DT_S, dropped)
                recording, origin = recording_of(_told_apart(part), source, front=True)
                yield from cut(
                    recording, source=SOURCE, scenario=name, unit_id=recording_id, origin_m=origin, scene_s=scene_s
                )
        if not found:
            raise InputError(f"{file} has no usable row: no vehicle, frame and time can be read")


def sniff(path: Path) -> bool:
    """True for a table of NGSIM, or a folder with one."""
    files = matching(path, "*.csv", "*.txt")[:20]
    return any(has_header(file) or (file.suffix == ".txt" and is_original(file)) for file in files)


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise InputError(f"{path} does not exist; give a file of NGSIM, or a folder of them")
    files = [f for f in sorted([*path.glob("*.csv"), *path.glob("*.txt")]) if has_header(f) or is_original(f)]
    if not files:
        raise InputError(f"{path} holds no table of NGSIM (a CSV of the portal, or text of 18 or 24 columns)")
    return files


def _periods(table: pl.DataFrame) -> Iterator[tuple[str, pl.DataFrame, dict[str, int]]]:
    """The periods of a site in the order of their offsets; the first carries the rows that belong to none."""
    sound = pl.all_horizontal(pl.col("frame_id", "time").is_finite().fill_null(False)) & pl.col("agent").is_not_null()
    sound &= (pl.col("time").abs() < MAX_WALL_MS) & (pl.col("frame_id").abs() < MAX_WALL_MS / STEP_MS)
    readable = table.filter(sound)
    offset = (pl.col("time") - STEP_MS * pl.col("frame_id")).round(0).cast(pl.Int64)
    readable = readable.with_columns(offset=offset)
    sizes = readable["offset"].value_counts().sort("offset")
    enough = sizes.filter(pl.col("count") >= max(2, MIN_PERIOD_SHARE * readable.height))
    kept = readable.filter(pl.col("offset").is_in(enough["offset"].implode()))
    dropped = {"unreadable": table.height - readable.height, "off_clock": readable.height - kept.height}
    for value in enough["offset"].to_list():
        part = kept.filter(pl.col("offset") == value).with_columns(frame=pl.col("frame_id").round(0).cast(pl.Int64))
        first = int(part["frame"].min())  # type: ignore[arg-type]
        yield f"{value / 1000:.1f}", part.with_columns(pl.col("frame") - first), dropped
        dropped = {}


def _told_apart(table: pl.DataFrame) -> pl.DataFrame:
    """The rows with a new name for a vehicle that took over another one's identifier."""
    table = table.sort("agent", "frame", maintain_order=True)
    changed = pl.any_horizontal(pl.col("length", "width", "kind").diff().over("agent").fill_null(0) != 0)
    gone = pl.col("frame").diff().over("agent").fill_null(0) > IDENTITY_GAP_S / DT_S
    turn = (changed | gone).cast(pl.Int32).cum_sum().over("agent")
    again = pl.format("{}/{}", "agent", turn + 1)
    return table.with_columns(agent=pl.when(turn > 0).then(again).otherwise(pl.col("agent")))
