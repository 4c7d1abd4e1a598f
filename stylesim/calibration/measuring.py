"""Runs a trial calibration on the road and measures what became of every driver."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int64

from stylesim.calibration.behaviours import BEHAVIOURS
from stylesim.labelers.tdbm import TDBM
from stylesim.labels import StyleLabels
from stylesim.population import Population
from stylesim.scene import Scene
from stylesim.simulation.generate import generate
from stylesim.style import STYLE_CLASSES
from stylesim.styles import COMFORT, road_kind

LEAST_S = 20.0  # who is seen for a shorter time is not judged (issue of the fidelity targets) [ours]


@dataclass(frozen=True, eq=False)
class Trial:
    """Every judged driver of a round: what it was told, what it measured as."""

    scenario: tuple[str, ...]
    road: tuple[str, ...]  # kind of road, `styles.road_kind`
    commanded: Int64[np.ndarray, " driver"]
    measured: Int64[np.ndarray, " driver"]
    knob: Float64[np.ndarray, " driver"]
    a: Float64[np.ndarray, " driver"]
    margin: Float64[np.ndarray, " driver"]  # score of the commanded class minus the best of the others
    behaviour: Float64[np.ndarray, "driver behaviour"]  # logs, in the order of BEHAVIOURS
    collisions: int

    def __len__(self) -> int:
        """Number of judged drivers."""
        return len(self.commanded)

    def recall(self, who: Bool[np.ndarray, " driver"] | None = None) -> Float64[np.ndarray, " style"]:
        """Of each class the share that measured as commanded; NaN where there is none."""
        kept = np.ones(len(self), bool) if who is None else who
        hit = [(self.measured[kept & (self.commanded == i)] == i) for i in range(len(STYLE_CLASSES))]
        return np.array([h.mean() if len(h) else np.nan for h in hit])


def run_trial(
    scenarios: Sequence[str],
    population: Population,
    labeler: TDBM,
    *,
    seed: int,
    episodes: int,
    workers: int,
    progress: Callable[[int, int], None] | None = None,
) -> Trial:
    """Simulates `episodes` of each scenario and labels whole trips; nothing is kept on disk."""
    with tempfile.TemporaryDirectory(prefix="stylesim-calibration-") as folder:
        corpus = generate(
            scenarios, population, episodes=episodes, seed=seed, out=Path(folder) / "trial", workers=workers,
            progress=progress,
        )  # fmt: skip
        return trial_of((scene, labeler.label_windows(scene)) for scene in corpus)


def trial_of(labelled: Iterable[tuple[Scene, StyleLabels]]) -> Trial:
    """The judged drivers of labelled scenes."""
    collisions = 0
    scenario: list[str] = []
    road: list[str] = []
    rows: list[tuple[float, ...]] = []
    logs: list[Float64[np.ndarray, " behaviour"]] = []
    for scene, labels in labelled:
        collisions += scene.counts.get("collisions", 0)
        limit = scene.parameters.get("speed_limit_mps")
        seen_s = scene.tracks.valid.sum(axis=1) * scene.tracks.dt_s
        place = {name: i for i, name in enumerate(scene.tracks.agent_id)}
        for row, agent in enumerate(labels.agent_id):
            driver = scene.tracks.driver[place[agent]]
            if driver is None or driver.name not in STYLE_CLASSES or seen_s[place[agent]] < LEAST_S:
                continue
            if labels.style[row] < 0:
                continue
            own = STYLE_CLASSES.index(driver.name)
            score = labels.score[row].astype(np.float64)
            margin = score[own] - np.delete(score, own).max()
            rows.append((own, labels.style[row], driver.aggressiveness, labels.aggressiveness[row], margin))
            values = [
                driver.desired_speed_factor * (limit or 1.0) if b.name == COMFORT else getattr(driver, b.name)
                for b in BEHAVIOURS
            ]
            logs.append(np.log(np.maximum(values, 1e-3)))
            scenario.append(scene.scenario)
            road.append(road_kind(limit))
    table = np.array(rows, np.float64).reshape(-1, 5)
    return Trial(
        scenario=tuple(scenario),
        road=tuple(road),
        commanded=table[:, 0].astype(np.int64),
        measured=table[:, 1].astype(np.int64),
        knob=table[:, 2],
        a=table[:, 3],
        margin=table[:, 4],
        behaviour=np.array(logs).reshape(-1, len(BEHAVIOURS)),
        collisions=collisions,
    )
