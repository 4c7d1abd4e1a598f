"""Pairs of an episode and its counterfactual, and what may be asked about the driver that differs between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from stylesim.corpus import Corpus
from stylesim.evaluation.asking import checked_answers, reveal
from stylesim.forecast import Forecast, Forecaster, ForecastTask, covered, earlier_s
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, earlier_scene, target_agents

TWIN, NULL = "twin", "null"
FROM_START = "another style from the start"  # asked apart: the pasts differ


@dataclass(frozen=True, eq=False)
class TwinPair:
    """An episode, its twin, and its null twin where there is one: in each `driver` is the one that differs.

    `t0` is the last frame that all share, None where they differ from the start.
    """

    own: Scene
    twin: Scene
    null: Scene | None
    driver: str
    t0: int | None

    @property
    def unit(self) -> str:
        """The unit that is resampled: the episode within its scenario."""
        return f"{self.own.scenario}:{self.own.unit_id}"


@dataclass(frozen=True, eq=False)
class TwinQuestion:
    """The task and the truth of one driver in one of both worlds, and its whole scene under the episode's ids."""

    task: ForecastTask
    truth_m: Float32[np.ndarray, "1 time 2"]
    shown: Scene


def twin_pairs(corpora: Sequence[Corpus], counts: Counter[str]) -> Iterator[TwinPair]:
    """Every twin of the corpora with its episode; twins whose episode is missing are counted."""
    for corpus in corpora:
        known = {info.scene_id for info in corpus.info}
        for info in corpus.info:
            if not info.scene_id.endswith(f"-{TWIN}"):
                continue
            twin = corpus.scene(info.scene_id)
            if twin.twin_of not in known:
                counts["twin without its episode"] += 1
                continue
            null_id = f"{twin.twin_of}-{NULL}"
            about = twin.metadata["twin"]
            at_s = about["at_s"]
            yield TwinPair(
                corpus.scene(twin.twin_of), twin, corpus.scene(null_id) if null_id in known else None,
                about["driver"], None if at_s is None else round(at_s / twin.tracks.dt_s),
            )  # fmt: skip


def twin_question(
    scene: Scene, named: Scene, driver: str, t0: int, spec: WindowSpec, answering: Sequence[Forecaster]
) -> TwinQuestion | None:
    """The task and the truth of one driver; None where it cannot be asked, or not of all of `answering`.

    The task carries the ids of `named`, the episode, so that no name tells a forecaster which future it is in (and a
    file of predictions, made for the episode, speaks of both).
    """
    history, future, _ = spec.steps(scene.tracks.dt_s)
    if driver not in scene.tracks.agent_id or t0 + future >= scene.tracks.n_frames:
        return None
    agent = scene.tracks.agent_id.index(driver)
    if agent not in target_agents(scene, t0, spec):
        return None
    shown = replace(scene, scene_id=named.scene_id, unit_id=named.unit_id, source_scenario_id=named.source_scenario_id)
    earlier = earlier_scene(shown, t0, history, earlier_s(answering))
    task = ForecastTask(shown.history(t0, history), np.array([agent], np.int32), future, t0, earlier)
    if not covered(answering, task).all():
        return None
    return TwinQuestion(task, scene.tracks.position_m[agent, t0 + 1 : t0 + 1 + future][None], shown)


def twin_answer(forecaster: Forecaster, question: TwinQuestion) -> Forecast:
    """The forecast, one task at a time, so that no batching parts what is alike; an oracle is told this side."""
    reveal(forecaster, question.shown)
    return checked_answers(forecaster, [question.task])[0]
