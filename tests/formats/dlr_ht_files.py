"""Files in the format of DLR Highway Traffic, written by the tests: those of DLR Urban Traffic and one column more."""

from __future__ import annotations

import gzip
from pathlib import Path

from tests.formats import dlr_ut_files as dlr

COLUMNS = (*dlr.COLUMNS[:10], "acceleration_signed", *dlr.COLUMNS[10:])


def write(folder: Path, table: list[dict[str, object]]) -> Path:
    """A trajectories file with those rows."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [",".join(COLUMNS), *(",".join(str(row.get(c, 0.0)) for c in COLUMNS) for row in table)]
    path = folder / f"trajectories_{dlr.STAMP}.csv.gz"
    path.write_bytes(gzip.compress(("\n".join(lines) + "\n").encode(), mtime=0))
    return path


def sample(folder: Path) -> Path:
    """A recording of 30 s at 33 m/s with an interpolated row and a damaged one."""
    table = dlr.rows(n_frames=600, speed_mps=33.0, interpolated=((0, 30),))
    table[3]["center_easting"] = "x"
    write(folder, table)
    return folder
