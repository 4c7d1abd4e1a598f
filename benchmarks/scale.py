"""Reading a large data set: speed, memory and disk, and what they make of 1 TB.

    python -m benchmarks.scale [--gigabytes 10] [--workers 2] [--scenario DIR] [--quick] [--folder DIR]

One Argoverse 2 scenario is repeated until the source has so many GB, each time under a new id and moved by another
part of a metre: else every map would be the same road, which a corpus keeps once. Each run is a fresh process on a
source that goes on where the smaller one ended; the disk cache holds it, so the disk's own bandwidth is not measured.
Extrapolated is from the largest run, the others give the spread. CPU seconds are those of all processes: on a machine
with other work they say more than wall time. Disk is not taken from the repeated scenarios, whose tracks are so alike
that they compress to almost nothing, but from the different ones of --data. With --folder each run is noted there when
it ends, and a repeated command goes on after it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl

SHARES = (0.01, 0.05, 0.2, 1.0)  # of the asked size
QUICK_GB = 0.1  # a minute
READ = """
import resource, sys
from stylesim.datasets.reading import read
if __name__ == "__main__":
    read("av2", sys.argv[1], out=sys.argv[2], workers=int(sys.argv[3]))
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(*(one.ru_maxrss / 1024 for one in used), sum(one.ru_utime + one.ru_stime for one in used))
"""


def size_of(folder: Path, *patterns: str) -> int:
    """Bytes of the files there that match (each name counts, also a hard link)."""
    return sum(file.stat().st_size for pattern in patterns for file in folder.rglob(pattern) if file.is_file())


class Moved:
    """A map file whose every x can be moved; its text is taken apart once."""

    def __init__(self, file: Path) -> None:
        parts = re.split(rb'("x":\s*)(-?[0-9.]+)', file.read_bytes())
        self._x = [float(part) for part in parts[2::3]]
        self._between = [a + b for a, b in zip(parts[0::3], [*parts[1::3], b""], strict=True)]

    def by(self, metres: float) -> bytes:
        """The text of the moved map."""
        moved = [b"%.3f" % (x + metres) for x in self._x] + [b""]
        return b"".join(piece for pair in zip(self._between, moved, strict=True) for piece in pair)


def disk(source: Path, folder: Path) -> None:
    """Print what a corpus of different scenarios takes against its source."""
    from stylesim.datasets.reading import read

    corpus = read("av2", source, out=folder / "disk")
    tracks, given = size_of(source, "*.parquet"), size_of(source, "*")
    ours = sum(size_of(corpus.path / kind, "*") for kind in ("tracks", "agents", "signals"))
    kept = size_of(corpus.path, "*")
    print(f"disk, {len(corpus)} different scenarios: tracks {ours / tracks:.2f} of the source's (target 1.2), ", end="")
    print(f"whole corpus {kept / given:.2f} of the whole source")


def written(scenario: Path, target: Path, gigabytes: float) -> None:
    """Repeat a scenario's folder in `target` until it has so many GB; what is there already counts."""
    table = pl.read_parquet(next(scenario.glob("scenario_*.parquet")))
    road = Moved(next(scenario.glob("log_map_archive_*.json")))
    target.mkdir(parents=True, exist_ok=True)
    made, total = sum(1 for _ in target.iterdir()), size_of(target, "*")
    while total < gigabytes * 1e9:
        name = f"{made:08d}"
        folder = target / name
        folder.mkdir()
        file = folder / f"scenario_{name}.parquet"
        by = float(np.random.default_rng(made).random())
        table.with_columns(pl.col("position_x") + by, scenario_id=pl.lit(name)).write_parquet(file)
        map_file = folder / f"log_map_archive_{name}.json"
        map_file.write_bytes(road.by(by))
        total += file.stat().st_size + map_file.stat().st_size
        made += 1


def run(source: Path, folder: Path, workers: int) -> dict[str, float]:
    """Read the source in a fresh process; what it took."""
    script, out = folder / "script.py", folder / "corpus"
    script.write_text(READ)
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(script), str(source), str(out), str(workers)], check=True, capture_output=True, text=True
    )
    wall_s = time.perf_counter() - begin
    parent, worker, cpu_s = (float(value) for value in done.stdout.split())
    shutil.rmtree(out)
    return {
        "gb": size_of(source, "*") / 1e9, "scenarios": sum(1 for _ in source.iterdir()), "wall_s": wall_s,
        "cpu_s": cpu_s, "parent_mib": parent, "worker_mib": worker, "load": os.getloadavg()[1], "workers": workers,
    }  # fmt: skip


def report(rows: list[dict[str, float]]) -> None:
    """Print what the runs say together."""
    first, last = rows[0], rows[-1]
    before = rows[-2] if len(rows) > 1 else first  # small runs grow by what Python and its libraries load
    slope = (last["parent_mib"] - before["parent_mib"]) / max(last["scenarios"] - before["scenarios"], 1)
    n_tb = 1000 / last["gb"] * last["scenarios"]
    print(f"growth of the peak, {first['scenarios']:.0f} to {last['scenarios']:.0f} scenarios: parent ", end="")
    print(f"{last['parent_mib'] / first['parent_mib']:.2f}, worker {last['worker_mib'] / first['worker_mib']:.2f}")
    speeds = [row["gb"] / row["wall_s"] * 3600 for row in rows]
    per_cpu = [row["gb"] / row["cpu_s"] * 3600 for row in rows]
    for name, values in (("GB per hour", speeds), ("GB per CPU hour", per_cpu)):
        print(f"{name}, n = {len(rows)}: {statistics.median(values):.2f} [{min(values):.2f} .. {max(values):.2f}]")
    print(f"1 TB is {n_tb:.0f} such scenarios; {last['workers']:.0f} workers: {1000 / speeds[-1]:.0f} h ", end="")
    print(f"[{1000 / max(speeds):.0f} .. {1000 / min(speeds):.0f}], {1000 / per_cpu[-1]:.0f} CPU hours,")
    print(f"parent {last['parent_mib'] + slope * (n_tb - last['scenarios']):.0f} MiB if its growth goes on in a line")


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
    parser.add_argument("--folder", type=Path, help="where the source and the runs are kept; default: nowhere")
    asked = parser.parse_args()
    scenario = asked.scenario or min(p for p in asked.data.iterdir() if p.is_dir())
    gigabytes = QUICK_GB if asked.quick else asked.gigabytes
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        notes = folder / "runs.jsonl"
        rows = [json.loads(line) for line in notes.read_text().splitlines()] if notes.is_file() else []
        for share in SHARES:
            if any(row["gb"] >= gigabytes * share for row in rows):
                continue
            written(scenario, folder / "source", gigabytes * share)
            rows.append(run(folder / "source", folder, asked.workers))
            with notes.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        for row in rows:
            print(f"{row['gb']:8.3f} GB, {row['scenarios']:.0f} scenarios: {row['wall_s']:.0f} s, ", end="")
            print(
                f"{row['cpu_s']:.0f} CPU s (load {row['load']:.1f}), peak {row['parent_mib']:.0f} MiB (parent), ",
                end="",
            )
            print(f"{row['worker_mib']:.0f} (largest worker)")
        report(rows)
        disk(asked.data, Path(temporary))


if __name__ == "__main__":
    main()
