"""Reading a data set: our reader against the format's own devkit, and memory of a small and a large one.

    python -m benchmarks.reading [--data ../shared/data] [--devkit-python av2=/path/to/python ...] [--times 10]
                                 [--only av2 ...]

Each figure is from a fresh process that reads everything once before the clock starts (imports, compiled code, disk
cache), then once more with it. Both sides read the same files, tracks and map, the runs are interleaved. CPU seconds
count every thread. trajdata has no way to read but into its own cache on disk: it is held against `read`, which writes
a corpus, on one recorded Waymo scenario under TIMES names. A devkit is measured where a Python that has it is named; an
environment of its own is made by `python -m venv ENV && ENV/bin/pip install av2==0.3.6`.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

RUNS = 5
TARGET = 5.0
GROWTH = 8  # the larger data set of the memory figures

CLOCK = """
import sys, time
from pathlib import Path
root, found = Path(sys.argv[1]), 0
for timed in (False, True):
    wall, cpu, found = time.perf_counter(), time.process_time(), 0
    {body}
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
print(wall, cpu, found)
"""
OURS = """
    from stylesim.datasets.formats import dataset_format
    for scene in dataset_format({name!r}).scenes()(root):
        found += int(scene.tracks.valid.sum())
"""
TO_DISK = """
    import shutil, tempfile
    from stylesim.datasets.reading import read
    with tempfile.TemporaryDirectory() as folder:
        corpus = read({name!r}, root, out=Path(folder) / "corpus")
        found = corpus.manifest["n_steps"]
"""
# What the devkit offers for the same content: every state of every track, and the vector map as objects.
AV2 = """
    from av2.datasets.motion_forecasting.scenario_serialization import load_argoverse_scenario_parquet
    from av2.map.map_api import ArgoverseStaticMap
    for file in sorted(root.glob("*/scenario_*.parquet")):
        scenario = load_argoverse_scenario_parquet(file)
        found += sum(len(track.object_states) for track in scenario.tracks)
        lanes = ArgoverseStaticMap.from_json(next(file.parent.glob("log_map_archive_*.json")))
"""
COMMONROAD = """
    import logging, warnings
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    from commonroad.common.file_reader import CommonRoadFileReader
    for file in sorted(root.glob("*.xml")):
        scenario, _ = CommonRoadFileReader(str(file)).open()
        found += sum(1 + len(o.prediction.trajectory.state_list) for o in scenario.dynamic_obstacles)
"""
TRAJDATA = """
    import contextlib, shutil, tempfile
    from trajdata import UnifiedDataset
    from trajdata.caching.df_cache import DataFrameCache
    with tempfile.TemporaryDirectory() as name, contextlib.redirect_stdout(sys.stderr):
        folder = Path(name)
        shutil.copytree(root, folder / "raw" / "training")
        data = UnifiedDataset(desired_data=["waymo_train"], data_dirs=dict(waymo_train=str(folder / "raw")),
            cache_location=str(folder / "cache"), incl_vector_map=True, num_workers=0, verbose=False)
        found = sum(len(DataFrameCache(folder / "cache", scene).scene_data_df) for scene in data.scenes())
"""
READ = """
import resource, sys
from stylesim.datasets.reading import read
read({name!r}, sys.argv[1], out=sys.argv[1] + ".corpus")
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@dataclass(frozen=True)
class Case:
    """One format: where its files are under the data folder, and how its devkit reads them ("": it has none here)."""

    name: str
    folder: str
    devkit: str = ""
    ours: str = OURS
    kit: str = ""  # its name in --devkit-python, where that is not the format's


# Formats without a devkit that installs beside a current numpy are listed for their speed alone.
CASES: tuple[Case, ...] = (
    Case("av2", "av2", AV2),
    Case("womd", "womd/tfrecord"),
    Case("womd", "womd/tfrecord", TRAJDATA, TO_DISK, "trajdata"),
    Case("gpudrive", "womd/json"),
    Case("scenarionet", "scenarionet"),
    Case("nuplan", "nuplan"),
    Case("lyft", "lyft"),
    Case("commonroad", "commonroad", COMMONROAD),
    Case("interaction", "interaction"),
    Case("taf_bw", "taf_bw"),
    Case("ngsim", "ngsim"),
    Case("dlr_ht", "dlr_ht"),
    Case("smarts", "smarts_i80"),
)


def run(python: str, code: str, path: Path) -> list[float]:
    """The numbers that a piece of code prints for a path, in a fresh process."""
    done = subprocess.run([python, "-c", code, str(path)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{python} failed:\n{done.stderr[-2000:]}")
    return [float(value) for value in done.stdout.split()]


def spread(values: list[float]) -> str:
    """Median [least .. most]."""
    return f"{statistics.median(values):.3f} [{min(values):.3f} .. {max(values):.3f}]"


def repeated(source: Path, target: Path, times: int) -> None:
    """A data set of folders (av2), copied under new names as often as asked."""
    for number in range(times):
        for folder in sorted(p for p in source.iterdir() if p.is_dir()):
            made = target / f"{number:04d}-{folder.name}"
            made.mkdir(parents=True)
            for file in folder.iterdir():
                shutil.copyfile(file, made / file.name)


def renamed(source: Path, target: Path, times: int) -> None:
    """One TFRecord file with the scenarios of a file, each under so many ids of the same length."""
    from stylesim.datasets.tfrecord import framed, records
    from stylesim.datasets.womd import scenes

    (file,) = source.glob("*tfrecord*")
    names = [scene.source_scenario_id.encode() for scene in scenes(file)]
    target.mkdir()
    with (target / file.name).open("wb") as made:
        for number in range(times):
            for name, record in zip(names, records(file), strict=True):
                own = b"%0*d" % (min(len(name), 6), number) + name[6:]
                made.write(framed(record.replace(name, own)))


def compare(case: Case, path: Path, python: str | None) -> None:
    """Print one row: CPU seconds of ours and of the devkit, and their ratio run by run."""
    size = sum(f.stat().st_size for f in path.rglob("*") if f.is_file()) / 1e6
    ours_code = CLOCK.format(body=case.ours.format(name=case.name).strip())
    theirs_code = CLOCK.format(body=case.devkit.strip()) if case.devkit else ""
    ours, theirs = [], []
    for _ in range(RUNS):
        ours.append(run(sys.executable, ours_code, path))
        if python and theirs_code:
            theirs.append(run(python, theirs_code, path))
    cpu = [r[1] for r in ours]
    print(f"{case.kit or case.name:12}{size:8.1f} MB  ours {spread(cpu)} CPU s, wall {spread([r[0] for r in ours])} s,")
    print(f"{'':12}{size / statistics.median(cpu):8.1f} MB per CPU second, {ours[0][2]:.0f} agent-frames")
    if theirs:
        if theirs[0][2] != ours[0][2]:
            print(f"{'':12}the devkit gives {theirs[0][2]:.0f} agent-frames")
        ratio = [b[1] / a[1] for a, b in zip(ours, theirs, strict=True)]
        wall = [b[0] / a[0] for a, b in zip(ours, theirs, strict=True)]
        print(f"{'':12}devkit {spread([r[1] for r in theirs])} CPU s, wall {spread([r[0] for r in theirs])} s")
        print(f"{'':12}times as fast: CPU {spread(ratio)}, wall {spread(wall)}, n = {RUNS} (target {TARGET:g})")
    elif case.devkit:
        print(f"{'':12}devkit not measured: no --devkit-python {case.kit or case.name}=… given")


def memory(source: Path, folder: Path, times: int) -> None:
    """Print the peak of reading av2 once and GROWTH times as large."""
    peaks = []
    for factor in (1, GROWTH):
        path = folder / f"memory{factor}"
        repeated_ids(source, path, times * factor)
        peaks.append(run(sys.executable, READ.format(name="av2"), path)[0])
        shutil.rmtree(path)
    growth = peaks[1] / peaks[0]
    small, large = 2 * times, 2 * times * GROWTH
    print(f"memory of read: {small} scenarios {peaks[0]:.0f} MiB, {large} {peaks[1]:.0f} MiB ({growth:.2f} times)")


def repeated_ids(source: Path, target: Path, times: int) -> None:
    """As `repeated`, with scenario ids of their own, so that a corpus takes them all."""
    import polars as pl

    repeated(source, target, times)
    for folder in target.iterdir():
        file = next(folder.glob("scenario_*.parquet"))
        pl.read_parquet(file).with_columns(scenario_id=pl.lit(folder.name)).write_parquet(file)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--devkit-python", action="append", default=[], metavar="FORMAT=PYTHON")
    parser.add_argument("--times", type=int, default=10, help="how often the scenarios of av2 and Waymo are repeated")
    parser.add_argument("--only", action="append", default=[], metavar="FORMAT", help="only these; default: all")
    asked = parser.parse_args()
    pythons = dict(item.split("=", 1) for item in asked.devkit_python)
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            kit = case.kit or case.name
            if asked.only and kit not in asked.only:
                continue
            path = asked.data / case.folder
            if not path.is_dir():
                print(f"{case.name:12}no files at {path}: skipped")
                continue
            if case.name == "av2":
                path = Path(folder) / "av2"
                repeated(asked.data / case.folder, path, asked.times)
            if case.kit == "trajdata":
                path = Path(folder) / "womd"
                renamed(asked.data / case.folder, path, asked.times)
            compare(case, path, pythons.get(kit))
        if (not asked.only or "av2" in asked.only) and (asked.data / "av2").is_dir():
            memory(asked.data / "av2", Path(folder), asked.times)


if __name__ == "__main__":
    main()
