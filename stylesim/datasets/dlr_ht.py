"""DLR Highway Traffic: a stretch of the A39 near Braunschweig, tracked at 20 Hz.

A recording is `trajectories_<begin>_<end>.csv.gz` in the columns of DLR Urban Traffic and `acceleration_signed`
(22 in all). There is no map and there are no lights. Lanes are not inferred either: the way of `inferred_road`, which
compares every two paths, takes hours for the two kilometres and 188 vehicles of one minute.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stylesim.datasets.cutting import SCENE_S, cut
from stylesim.datasets.dlr_folders import JOINED_WITHIN_S, track_files
from stylesim.datasets.dlr_tables import recording_from
from stylesim.datasets.resampling import decimated
from stylesim.datasets.sniffing import header, matching
from stylesim.datasets.stamps import Stamp
from stylesim.datasets.track_table import ORIGIN_ROWS
from stylesim.scene import Scene

SOURCE = "dlr_ht"
SITE = "a39_braunschweig"


def scenes(path: str | Path, *, scene_s: float = SCENE_S) -> Iterator[Scene]:
    """The scenes of a recording, or of every recording in a folder, in time, at 10 Hz.

    InputError names the file that is missing, damaged, or in other units.
    """
    unit_id, unit_begin, previous = "", 0, None
    for file in track_files(Path(path), "DLR Highway Traffic"):
        stamp = Stamp.of(file)
        raw, begin = recording_from(file, None, stamp, source=SOURCE)
        if stamp is None or previous is None or not stamp.continues(previous, within_s=JOINED_WITHIN_S):
            unit_id, unit_begin = raw.recording_id, begin
        previous = stamp
        begins = np.argsort(raw.frame, kind="stable")[:ORIGIN_ROWS]
        origin = np.round(np.median(raw.position_m[begins], axis=0), -2)
        yield from cut(
            decimated(raw),
            source=SOURCE,
            scenario=SITE,
            unit_id=unit_id,
            origin_m=origin,
            scene_s=scene_s,
            unit_start_s=(begin - unit_begin) / 1e6,
        )


def sniff(path: Path) -> bool:
    """True for a trajectories file with the columns of DLR Highway Traffic, or a folder with one."""
    files = [path] if path.is_file() else matching(path, "trajectories_*.csv", "trajectories_*.csv.gz")
    return bool(files) and {"center_easting", "acceleration_signed", "interpolated"} <= set(header(files[0]))
