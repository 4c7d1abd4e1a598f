"""`PredictionFile`: forecasts that were made elsewhere, by whatever, and are only looked up here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from stylesim.errors import InputError
from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.rates import path_at

ANY_T0 = -1  # the file does not say which t0: it is the one that the scene's source fixes


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a file says of one (scenario, agent): modes in the source's own frame, in metres, and confidences >= 0."""

    mode_m: Float64[np.ndarray, "mode step 2"]
    confidence: Float64[np.ndarray, " mode"]


Key = tuple[str, str, int]  # scenario id, track id, t0 frame or ANY_T0


class PredictionFile:
    """A table of predictions as a `Forecaster`.

    Scenes are found by the scenario id of their source (or by our scene id), agents by their track id, t0 by its frame
    or, where the file names none, as the frame that the source fixes (Argoverse 2: 4.9 s, Waymo: 1.0 s). `covers`
    says which agents of a task the file speaks of; asking for another is an InputError.
    """

    def __init__(self, name: str, table: Mapping[Key, Predicted], *, dt_s: float) -> None:
        if not table:
            raise InputError(f"{name} holds no prediction")
        self.name = name
        self._table = table
        self._dt_s = dt_s
        self.horizon_s = min(item.mode_m.shape[1] for item in table.values()) * dt_s

    def _find(self, task: ForecastTask, agent: int) -> Predicted | None:
        scene = task.scene
        for scenario in (scene.source_scenario_id, scene.scene_id):
            for t0 in (task.t0_frame, ANY_T0):
                found = self._table.get((scenario, scene.tracks.agent_id[agent], t0))
                if found is not None:
                    return found
        return None

    def covers(self, task: ForecastTask) -> Bool[np.ndarray, " driver"]:
        """True for the agents of the task that the file has a prediction of."""
        return np.array([self._find(task, int(agent)) is not None for agent in task.agent_index], bool)

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """The file's modes, moved into the scene's frame and rate."""
        return [self._one(task) for task in tasks]

    def _one(self, task: ForecastTask) -> Forecast:
        tracks = task.scene.tracks
        found = [self._find(task, int(agent)) for agent in task.agent_index]
        missing = [tracks.agent_id[int(a)] for a, item in zip(task.agent_index, found, strict=True) if item is None]
        if missing:
            raise InputError(f"{self.name} has no prediction of agent {missing[0]!r} in {task.scene.scene_id!r}")
        modes = max((len(item.confidence) for item in found if item is not None), default=1)
        path = np.zeros((len(found), modes, task.future_steps, 2))
        chance = np.zeros((len(found), modes))
        for row, (agent, item) in enumerate(zip(task.agent_index, found, strict=True)):
            assert item is not None
            start = tracks.position_m[agent, -1].astype(np.float64)
            there = (item.mode_m - tracks.origin_m)[None]
            steps = path_at(there, start[None], dt_s=self._dt_s, wanted_dt_s=tracks.dt_s, steps=task.future_steps)[0]
            n = len(steps)
            path[row, :n], path[row, n:] = steps, steps[:1]  # who has fewer modes: repeated with probability 0
            chance[row, :n] = item.confidence / item.confidence.sum()
        return Forecast(path.astype(np.float32), chance.astype(np.float32))


def collected(rows: Iterable[tuple[Key, Float64[np.ndarray, "step 2"], float]], *, where: str) -> dict[Key, Predicted]:
    """Rows of (key, path, confidence) by key, in the order of the file.

    InputError for a path that is not finite or of another length than the others of its key, and for confidences
    that are negative, not finite or all 0.
    """
    found: dict[Key, tuple[list[Float64[np.ndarray, "step 2"]], list[float]]] = {}
    for key, path, confidence in rows:
        place = f"{where}: scenario {key[0]!r}, track {key[1]!r}"
        if not (len(path) and np.isfinite(path).all()):
            raise InputError(f"{place}: a trajectory is empty or holds NaN")
        if not (np.isfinite(confidence) and confidence >= 0):
            raise InputError(f"{place}: a confidence of {confidence}; it must be a number >= 0")
        paths, confidences = found.setdefault(key, ([], []))
        if paths and len(paths[0]) != len(path):
            raise InputError(f"{place}: trajectories of {len(paths[0])} and {len(path)} steps")
        paths.append(path)
        confidences.append(confidence)
    for key, (_, confidences) in found.items():
        if sum(confidences) <= 0:
            raise InputError(f"{where}: scenario {key[0]!r}, track {key[1]!r}: every confidence is 0")
    return {key: Predicted(np.stack(paths), np.array(c, np.float64)) for key, (paths, c) in found.items()}
