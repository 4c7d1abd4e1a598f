"""Reading a large data set: speed, memory and disk, and what they make of 1 TB.

    python -m benchmarks.scale [--gigabytes 10] [--workers 2] [--scenario DIR] [--quick]

One Argoverse 2 scenario is repeated until the source has so many GB, each time under a new id and moved by another
part of a metre: else every map would be the same road, which a corpus keeps once. Each run is a fresh process on a
source of another size; the disk cache holds it, so the disk's own bandwidth is not measured. Extrapolated is from the
largest run, the others give the spread. Disk is not taken from the repeated scenarios, whose tracks are so alike that
they compress to almost nothing, but from the different ones of --data.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

SHARES = (0.125, 0.25, 0.5, 1.0)  # of the asked size
QUICK_GB = 0.1  # a minute
READ = """
import resource, sys
from stylesim.datasets.reading import read
if __name__ == "__main__":
    read("av2", sys.argv[1], out=sys.argv[2], workers=int(sys.argv[3]))
    peaks = [resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(*peaks)
"""


def size_of(folder: Path, *patterns: str) -> int:
    """Bytes of the files there that match (each name counts, also a hard link)."""
    return sum(file.stat().st_size for pattern in patterns for file in folder.rglob(pattern) if file.is_file())


def moved(value: Any, by: float) -> Any:
    """A map with every x moved by so many metres."""
    if isinstance(value, dict):
        return {key: item + by if key == "x" else moved(item, by) for key, item in value.items()}
    return [moved(item, by) for item in value] if isinstance(value, list) else value


def disk(source: Path, folder: Path) -> None:
    """Print what a corpus of different scenarios takes against its source."""
    from stylesim.datasets.reading import read

    corpus = read("av2", source, out=folder / "disk")
    tracks, given = size_of(source, "*.parquet"), size_of(source, "*")
    ours = sum(size_of(corpus.path / kind, "*") for kind in ("tracks", "agents", "signals"))
    kept = size_of(corpus.path, "*")
    print(f"disk, {len(corpus)} different scenarios: tracks {ours / tracks:.2f} of the source's (target 1.2), ", end="")
    print(f"whole corpus {kept / given:.2f} of the whole source")


def written(scenario: Path, target: Path, gigabytes: float) -> int:
    """Repeat a scenario's folder in `target` until it has so many GB; how many were made."""
    table = pl.read_parquet(next(scenario.glob("scenario_*.parquet")))
    road = json.loads(next(scenario.glob("log_map_archive_*.json")).read_bytes())
    rng = np.random.default_rng(0)
    made, total = 0, 0
    while total < gigabytes * 1e9:
        name = f"{made:08d}"
        folder = target / name
        folder.mkdir(parents=True)
        file = folder / f"scenario_{name}.parquet"
        by = float(rng.random())
        table.with_columns(pl.col("position_x") + by, scenario_id=pl.lit(name)).write_parquet(file)
        map_file = folder / f"log_map_archive_{name}.json"
        map_file.write_text(json.dumps(moved(road, by)))
        total += file.stat().st_size + map_file.stat().st_size
        made += 1
    return made


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--gigabytes", type=float, default=10.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--scenario", type=Path, help="folder of one Argoverse 2 scenario; default: the first of --data"
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data/av2"))
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_GB:g} GB instead")
    asked = parser.parse_args()
    scenario = asked.scenario or min(p for p in asked.data.iterdir() if p.is_dir())
    gigabytes = QUICK_GB if asked.quick else asked.gigabytes
    speeds, peaks = [], []
    for share in SHARES:
        with tempfile.TemporaryDirectory() as folder:
            source, out, script = Path(folder) / "source", Path(folder) / "corpus", Path(folder) / "script.py"
            n = written(scenario, source, gigabytes * share)
            script.write_text(READ)
            gb = size_of(source, "*") / 1e9
            begin = time.perf_counter()
            done = subprocess.run(
                [sys.executable, str(script), str(source), str(out), str(asked.workers)],
                check=True, capture_output=True, text=True,
            )  # fmt: skip
            hours = (time.perf_counter() - begin) / 3600
            parent, worker = (float(value) for value in done.stdout.split())
            speeds.append(gb / hours)
            peaks.append((n, parent, worker))
            print(f"{gb:8.3f} GB, {n} scenarios: {gb / hours:7.2f} GB/h, peak MiB ", end="")
            print(f"{parent:.0f} (parent), {worker:.0f} (largest worker)", flush=True)
    (n0, parent0, worker0), (n1, parent1, worker1) = peaks[0], peaks[-1]
    slope = (parent1 - parent0) / (n1 - n0)
    n_tb = 1000 / gb * n1
    print(f"growth of the peak, {n0} to {n1} scenarios: parent {parent1 / parent0:.2f}, ", end="")
    print(f"worker {worker1 / worker0:.2f}")
    print(f"GB/h, n = {len(speeds)}: {statistics.median(speeds):.2f} [{min(speeds):.2f} .. {max(speeds):.2f}]")
    low, high = 1000 / max(speeds), 1000 / min(speeds)
    print(f"1 TB is {n_tb:.0f} such scenarios; {asked.workers} workers: ", end="")
    print(f"{1000 / speeds[-1]:.0f} h [{low:.0f} .. {high:.0f}],")
    print(f"parent {parent1 + slope * (n_tb - n1):.0f} MiB if its growth goes on in a line")
    with tempfile.TemporaryDirectory() as folder:
        disk(asked.data, Path(folder))


if __name__ == "__main__":
    main()
