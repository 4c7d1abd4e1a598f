"""Vehicle-steps labelled per second on one core: a made scene, episodes of SUMO, a recording; target beside.

    python -m benchmarks.labelling [--agents 300] [--frames 600] [--episodes 4] [--repeats 7]

The made scene is a straight three-lane road with drivers who follow, wander and change lanes, so that its number does
not depend on a simulator. The others are sparse, and the recording's road is inferred: every driver is left out of its
own centre line there. "disk to disk" is the verb: tracks and histories, reading and writing included. Compilation is
excluded by one run before the first. Time is the process' own (CPU seconds of all threads), since other work on the
machine would otherwise count.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from stylesim.corpus import Corpus
from stylesim.datasets.reading import read
from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import default_labeler
from stylesim.labelers.rows import track_rows
from stylesim.labelers.tdbm import TDBM
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.simulation.generate import generate
from stylesim.tracks import Tracks
from stylesim.windows import WindowSpec, anchor_frames

LANE_M = 3.5
TARGET_PER_S = 1.0e6  # issue 2: TDBM + KDSC, per core
SCENARIOS = ("ramp_merge", "yellow_light")
RECORDING = Path(__file__).parent.parent / "data" / "dlr_ut"


def motorway(*, agents: int, frames: int, length_m: float, lanes: int, seed: int, pieces: int = 20) -> Scene:
    """Traffic on parallel lanes that are cut into `pieces` each, as maps cut them."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(frames) * 0.1
    speed = rng.uniform(8.0, 25.0, agents)[:, None] + rng.uniform(0.2, 2.0, (agents, 1)) * np.sin(
        time_s * rng.uniform(0.05, 0.6, (agents, 1)) + rng.uniform(0, 6, (agents, 1))
    )
    along = rng.uniform(0, length_m, agents)[:, None] + np.cumsum(speed, axis=1) * 0.1
    home = rng.integers(0, lanes, agents)
    target = np.clip(home + rng.integers(-1, 2, agents), 0, lanes - 1)
    moved = 1 / (1 + np.exp(-(time_s - rng.uniform(5, frames * 0.1, (agents, 1)))))
    across = LANE_M * (home[:, None] + (target - home)[:, None] * moved) + 0.3 * np.sin(
        time_s * 0.4 + rng.uniform(0, 6, (agents, 1))
    )
    velocity = np.stack([speed, np.gradient(across, 0.1, axis=1)], axis=-1)
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(agents)),
        kind=np.ones(agents, np.int8),
        size_m=np.tile(np.array([4.6, 1.8], np.float32), (agents, 1)),
        position_m=np.stack([along, across], axis=-1).astype(np.float32),
        velocity_mps=velocity.astype(np.float32),
        heading_rad=np.arctan2(velocity[..., 1], velocity[..., 0]).astype(np.float32),
        valid=np.ones((agents, frames), bool),
        dt_s=0.1,
    )
    step = (length_m + float(along.max())) / pieces
    road = Road(
        tuple(
            Lane(
                lane_id=f"{lane}.{piece}",
                centre_line_m=np.array(
                    [[piece * step, lane * LANE_M], [(piece + 1) * step, lane * LANE_M]], np.float32
                ),
                width_m=LANE_M,
                speed_limit_mps=36.1,
                successors=(f"{lane}.{piece + 1}",) if piece + 1 < pieces else (),
            )
            for lane in range(lanes)
            for piece in range(pieces)
        )
    )
    return Scene(scene_id="bench", unit_id="bench", source="synthetic", scenario="motorway", tracks=tracks, road=road)


def motorway_jobs(agents: int, frames: int, length_m: float) -> dict[str, tuple[Callable[[], object], int]]:
    """What is timed on the made scene: each job with its vehicle-steps."""
    scene = motorway(agents=agents, frames=frames, length_m=length_m, lanes=3, seed=0)
    tdbm, kdsc = TDBM().fit([scene]), KDSC().fit([scene])

    def both() -> None:
        rows = track_rows(scene, tdbm.options)
        tdbm.judge(rows)
        kdsc.judge(rows)

    steps = int(scene.tracks.valid.sum())
    return {
        "TDBM + KDSC, track": (both, steps),
        "TDBM alone, track": (lambda: tdbm.label_windows(scene), steps),
        "TDBM, history of 5 s": (lambda: tdbm.label_windows(scene, [0], 50, span="history"), agents * 50),
    }


def corpus_jobs(corpus: Corpus) -> dict[str, tuple[Callable[[], object], int]]:
    """What is timed on scenes in memory, and the verb from disk to disk. History steps count once for each t0."""
    labeler, spec, scenes = default_labeler("tdbm"), WindowSpec(), list(corpus)
    asked = {}
    for number, scene in enumerate(scenes):
        length = spec.steps(scene.tracks.dt_s)[0]
        asked[number] = ([t0 - length + 1 for t0 in anchor_frames(scene, spec)], length)
    steps = sum(int(scene.tracks.valid.sum()) for scene in scenes)
    history_steps = sum(
        int(scenes[number].tracks.valid[:, start : start + length].sum())
        for number, (starts, length) in asked.items()
        for start in starts
    )

    def tracks() -> None:
        for scene in scenes:
            labeler.label_windows(scene)

    def histories() -> None:
        for number, (starts, length) in asked.items():
            if starts:
                labeler.label_windows(scenes[number], starts, length, span="history")

    return {
        "TDBM, track": (tracks, steps),
        "TDBM, histories of 5 s": (histories, history_steps),
        "`label`, disk to disk": (lambda: label(corpus, labeler, spec=spec), steps),
    }


def timed(title: str, jobs: dict[str, tuple[Callable[[], object], int]], *, repeats: int) -> None:
    """Print one table."""
    print(f"\n{title}")
    print(f"  {'job':26}{'M vehicle-steps/s':>18}{'min .. max':>16}{'n':>4}{'target':>8}")
    for name, (job, count) in jobs.items():
        job()
        rates = []
        for _ in range(repeats):
            begin = time.process_time()
            job()
            rates.append(count / (time.process_time() - begin) / 1e6)
        middle, low, high = statistics.median(rates), min(rates), max(rates)
        print(f"  {name:26}{middle:18.2f}{low:9.2f} ..{high:5.2f}{repeats:4}{TARGET_PER_S / 1e6:8.2f}")


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=300)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--length", type=float, default=3000.0, help="metres on which the drivers start")
    parser.add_argument("--episodes", type=int, default=4, help="of each SUMO scenario; 0 leaves them out")
    parser.add_argument("--repeats", type=int, default=7)
    asked = parser.parse_args()
    title = f"synthetic motorway: {asked.agents} agents x {asked.frames} frames on {asked.length:g} m"
    timed(title, motorway_jobs(asked.agents, asked.frames, asked.length), repeats=asked.repeats)
    with tempfile.TemporaryDirectory() as folder:
        if asked.episodes:
            made = generate(SCENARIOS, "tdbm_spectrum", episodes=asked.episodes, seed=0, out=Path(folder) / "sumo")
            timed(f"{' and '.join(SCENARIOS)}: {len(made)} episodes", corpus_jobs(made), repeats=asked.repeats)
        recorded = read("dlr_ut", RECORDING, out=Path(folder) / "dlr")
        timed(f"DLR UT (inferred road): {len(recorded)} scenes", corpus_jobs(recorded), repeats=asked.repeats)


if __name__ == "__main__":
    main()
