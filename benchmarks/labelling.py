"""Vehicle-steps labelled per second on one core: TDBM and KDSC from one pass of features, and each alone.

    python benchmarks/labelling.py [--agents 300] [--frames 600] [--repeats 7]

The scene is a straight three-lane road of the given length with drivers who follow, wander and change lanes; it is
made here, so that the number does not depend on a simulator. Compilation is excluded by one run before the first.
Time is the process' own (CPU seconds), since other work on the machine would otherwise count.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from stylesim.labelers.kdsc import KDSC
from stylesim.labelers.rows import track_rows
from stylesim.labelers.tdbm import TDBM
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.tracks import Tracks

LANE_M = 3.5
TARGET_PER_S = 1.0e6  # issue 2: TDBM + KDSC, per core


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
        size_m=np.tile(np.float32([4.6, 1.8]), (agents, 1)),
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
                centre_line_m=np.float32([[piece * step, lane * LANE_M], [(piece + 1) * step, lane * LANE_M]]),
                width_m=LANE_M,
                speed_limit_mps=36.1,
                successors=(f"{lane}.{piece + 1}",) if piece + 1 < pieces else (),
            )
            for lane in range(lanes)
            for piece in range(pieces)
        )
    )
    return Scene(scene_id="bench", unit_id="bench", source="synthetic", scenario="motorway", tracks=tracks, road=road)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, default=300)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--length", type=float, default=3000.0, help="metres on which the drivers start")
    parser.add_argument("--repeats", type=int, default=7)
    asked = parser.parse_args()
    scene = motorway(agents=asked.agents, frames=asked.frames, length_m=asked.length, lanes=3, seed=0)
    tdbm, kdsc = TDBM().fit([scene]), KDSC().fit([scene])

    def both() -> None:
        rows = track_rows(scene, tdbm.options)
        tdbm.judge(rows)
        kdsc.judge(rows)

    jobs: dict[str, Callable[[], object]] = {
        "TDBM + KDSC, track": both,
        "TDBM alone, track": lambda: tdbm.label_windows(scene),
        "TDBM, history of 5 s": lambda: tdbm.label_windows(scene, [0], 50, span="history"),
    }
    steps = int(scene.tracks.valid.sum())
    print(f"{asked.agents} agents x {asked.frames} frames on {asked.length:g} m; target {TARGET_PER_S / 1e6:g} M/s")
    print(f"{'job':24}{'M vehicle-steps/s':>18}{'min .. max':>16}{'n':>4}")
    for name, job in jobs.items():
        job()
        count = asked.agents * 50 if "history" in name else steps
        rates = []
        for _ in range(asked.repeats):
            begin = time.process_time()
            job()
            rates.append(count / (time.process_time() - begin) / 1e6)
        print(f"{name:24}{statistics.median(rates):18.2f}{min(rates):9.2f} ..{max(rates):5.2f}{len(rates):4}")


if __name__ == "__main__":
    main()
