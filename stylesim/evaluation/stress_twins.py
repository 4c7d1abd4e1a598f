"""Counterfactual twins: two futures of one past. A forecast that has not seen the style must be the same for both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.corpus import Corpus
from stylesim.evaluation.asking import checked_answers, reveal
from stylesim.evaluation.intervals import Estimate, estimate
from stylesim.evaluation.metrics import MISS_THRESHOLD_M, forecast_errors
from stylesim.forecast import Forecaster, ForecastTask, covered, earlier_s
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, earlier_scene, target_agents

RATES = ("covers_own", "covers_twin", "covers_both")


@dataclass(frozen=True, eq=False)
class TwinForecasts:
    """Drivers whose style was switched at t0. A future is covered where a mode ends within 2 m of it."""

    drivers: int
    identical: int  # forecasts of both pasts (which are the same, bit for bit) that are the same, bit for bit
    figures: Mapping[str, Estimate]  # covers_own, covers_twin, covers_both (shares); apart_m: distance of both ends
    counts: Mapping[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        figures = {name: value.to_dict() for name, value in self.figures.items()}
        return {"drivers": self.drivers, "identical": self.identical, "figures": figures, "counts": dict(self.counts)}


def twin_forecasts(
    forecaster: Forecaster,
    corpora: Sequence[Corpus],
    *,
    spec: WindowSpec,
    modes: int,
    seed: int,
    beside: Sequence[Forecaster] = (),
) -> TwinForecasts | None:
    """Ask about every switched driver at its switch, of its own scene and of its twin's; None without twins."""
    rows: dict[str, list[float]] = {name: [] for name in (*RATES, "apart_m")}
    units: list[str] = []
    counts: Counter[str] = Counter()
    identical = 0
    for own, twin, driver, t0 in _pairs(corpora, counts):
        for scene in (own, twin):
            reveal(forecaster, scene)
        sides = [_question(scene, driver, t0, spec, (forecaster, *beside)) for scene in (own, twin)]
        if sides[0] is None or sides[1] is None:
            counts["switched driver not seen long enough, or not forecast by all"] += 1
            continue
        (task, truth), (other, other_truth) = sides[0], sides[1]
        answer, again = (checked_answers(forecaster, [one])[0] for one in (task, other))  # one at a time: no batching
        same = (answer.mode_m.tobytes(), answer.probability.tobytes()) == (
            again.mode_m.tobytes(), again.probability.tobytes(),
        )  # fmt: skip
        identical += same
        near = [
            float(forecast_errors(one.mode_m, one.probability, end, k=modes).min_fde_m[0]) <= MISS_THRESHOLD_M
            for one, end in ((answer, truth), (again, other_truth))
        ]
        rows["covers_own"].append(near[0])
        rows["covers_twin"].append(near[1])
        rows["covers_both"].append(all(near))
        rows["apart_m"].append(float(np.linalg.norm(truth[0, -1] - other_truth[0, -1])))
        units.append(f"{own.scenario}:{own.unit_id}")
    if not (units or counts):
        return None
    figures = {
        name: estimate(np.array(values, np.float64), units, seed=seed, purpose=f"twins {name}", rate=name in RATES)
        for name, values in rows.items()
    }
    return TwinForecasts(len(units), identical, figures, dict(counts))


def _pairs(corpora: Sequence[Corpus], counts: Counter[str]) -> Iterator[tuple[Scene, Scene, str, int]]:
    """(episode, its twin, the driver, frame of the switch) of every twin that was switched on the way."""
    for corpus in corpora:
        known = {info.scene_id for info in corpus.info}
        for info in corpus.info:
            if not info.scene_id.endswith("-twin"):
                continue
            twin = corpus.scene(info.scene_id)
            about = twin.metadata["twin"]
            if about["at_s"] is None or twin.twin_of not in known:
                counts["another style from the start, or without its episode"] += 1
                continue
            yield corpus.scene(twin.twin_of), twin, about["driver"], round(about["at_s"] / twin.tracks.dt_s)


def _question(
    scene: Scene, driver: str, t0: int, spec: WindowSpec, answering: Sequence[Forecaster]
) -> tuple[ForecastTask, np.ndarray] | None:
    """The task and the truth (1, time, 2); None where the driver cannot be asked."""
    history, future, _ = spec.steps(scene.tracks.dt_s)
    if driver not in scene.tracks.agent_id or t0 + future >= scene.tracks.n_frames:
        return None
    agent = scene.tracks.agent_id.index(driver)
    if agent not in target_agents(scene, t0, spec):
        return None
    earlier = earlier_scene(scene, t0, history, earlier_s(answering))
    task = ForecastTask(scene.history(t0, history), np.array([agent], np.int32), future, t0, earlier)
    if not covered(answering, task).all():
        return None
    return task, scene.tracks.position_m[agent, t0 + 1 : t0 + 1 + future][None]
