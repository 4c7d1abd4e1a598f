"""Make the road of a site from a recording, once and for all: `python -m stylesim.datasets.freeze_road`.

The shipped `sites/dlr_ut_braunschweig.json` is what this gives for `data/dlr_ut` (CC BY 4.0, DLR).
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import numpy as np

from stylesim.datasets.dlr_tables import recording_from
from stylesim.datasets.inferred_road import MAX_SPREAD_M, MIN_TRACKS, infer_road, lane_share
from stylesim.datasets.site_roads import SiteRoad, save_site_road
from stylesim.datasets.stamps import Stamp
from stylesim.errors import InputError


def freeze_road(tracks: Path, *, name: str, out: Path) -> SiteRoad:
    """Infer the lanes of a DLR recording, write them to `out` with their provenance, and return them.

    InputError where the file cannot be read or no lane in it is credible.
    """
    recording, _ = recording_from(tracks, None, Stamp.of(tracks))
    origin = np.round(recording.position_m[np.argmin(recording.frame)], -2)
    road = infer_road(recording, origin)
    if road is None:
        raise InputError(f"{tracks}: no lane is credible (needs {MIN_TRACKS} tracks within {MAX_SPREAD_M} m)")
    provenance = {
        "source_file": tracks.name,
        "source_sha256": hashlib.sha256(tracks.read_bytes()).hexdigest(),
        "licence": "CC BY 4.0, DLR, https://doi.org/10.5281/zenodo.15754836",
        "min_tracks": MIN_TRACKS,
        "max_spread_m": MAX_SPREAD_M,
        "motor_rows_within_2_m_of_a_lane": round(lane_share(road, recording, origin), 3),
    }
    site = SiteRoad(name, road, origin, provenance)
    save_site_road(site, out)
    return site


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tracks", type=Path, help="trajectories_*.csv.gz")
    parser.add_argument("--name", required=True, help="name of the site")
    parser.add_argument("--out", type=Path, required=True, help="the JSON file to write")
    chosen = parser.parse_args()
    freeze_road(chosen.tracks, name=chosen.name, out=chosen.out)


if __name__ == "__main__":
    _main()
