"""`ArrayForecaster`: a foreign model as a function of arrays, with its own units, rate and horizon.

The adapter owns units, rate and frame, so that nobody's model has to be changed to be examined:

    def predict(inputs):                      # arrays of N drivers, each in the driver's own frame at t0
        history = inputs["agent"]             # (N, agents, steps, 7): x, y, vx, vy, cos, sin of heading, seen
        return modes, probability             # (N, modes, future steps, 2), (N, modes)

    def factory():                            # stylesim evaluate my_package.adapter:factory CORPUS
        return ArrayForecaster("mine", predict, dt_s=0.5, history_s=2.0, future_s=6.0, unit_m=0.3048)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from stylesim.errors import InputError
from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.batching import Batch, gather, to_scene, to_target
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.rates import history_at, path_at
from stylesim.forecasting.samples import RoadCutter, add_window
from stylesim.forecasting.store import MemorySink, StoreBuilder
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames, target_agents

FOOT_M = 0.3048  # the international foot
LARGEST_JUMP_M = 50.0  # chosen: no first step lies so far away; a forecast in another frame or unit does
INPUTS = ("agent", "agent_attribute", "agent_valid", "piece", "piece_attribute", "piece_valid")

ArrayModel = Callable[[Mapping[str, np.ndarray]], Any]


class ArrayForecaster:
    """A function of arrays as a `Forecaster`.

    `model` gets a mapping of arrays (see `model_inputs`) and gives `modes (driver, mode, step, 2)` in the driver's
    frame at t0, or `(modes, probability (driver, mode))`; `(driver, step, 2)` is one mode. Its steps are `dt_s` apart,
    the first at t0 + dt_s, and reach `future_s`; lengths are in units of `unit_m` metres, times in seconds.
    Probabilities are scaled to sum to 1; without any, modes are equally probable. `road=False` hides the map.

    Raises InputError for rates and lengths that are not positive, and in `predict` where the model's answer has
    another shape, is not finite, or begins so far from the driver that frame or unit must be wrong.
    """

    def __init__(
        self,
        name: str,
        model: ArrayModel,
        *,
        dt_s: float,
        history_s: float,
        future_s: float,
        unit_m: float = 1.0,
        road: bool = True,
        agents: int = 16,
        polylines: int = 64,
        points: int = 10,
    ) -> None:
        for what, value in (("dt_s", dt_s), ("history_s", history_s), ("future_s", future_s), ("unit_m", unit_m)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name}: {what} must be a positive number, not {value!r}")
        if not name:
            raise InputError("a forecaster needs a name")
        self.name = name
        self.horizon_s = future_s
        self._model, self._unit_m, self._road = model, unit_m, road
        self._inputs = InputConfig(
            dt_s=dt_s,
            history_steps=max(1, round(history_s / dt_s)),
            future_steps=max(1, round(future_s / dt_s)),
            agents=agents,
            polylines=polylines,
            points=points,
        )
        self._cutter = RoadCutter(self._inputs)

    def predict(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        """Modes for every task in the frame, unit and rate of its scene."""
        return [self._one(task) for task in tasks]

    def examples(
        self, scenes: Iterable[Scene], *, stride_s: float = 3.0
    ) -> Iterator[tuple[dict[str, np.ndarray], Float32[np.ndarray, "driver step 2"]]]:
        """(what the model is given, what it should say) of every t0 of the scenes: to train it on what it will see.

        The future is in the driver's frame at t0, in the model's rate and unit, like its answer; all drivers of a t0
        are one batch. Scenes too short for a window give none.
        """
        inputs = self._inputs
        spec = WindowSpec(inputs.history_steps * inputs.dt_s, inputs.future_steps * inputs.dt_s, stride_s)
        for scene in scenes:
            tracks, (history, future, _) = scene.tracks, spec.steps(scene.tracks.dt_s)
            for t0 in anchor_frames(scene, spec):
                drivers = target_agents(scene, t0, spec)
                if not len(drivers):
                    continue
                batch = self._batch(ForecastTask(scene.history(t0, history), drivers, future, t0))
                truth = path_at(
                    tracks.position_m[drivers, t0 + 1 : t0 + 1 + future][:, None], batch.pose[:, :2],
                    dt_s=tracks.dt_s, wanted_dt_s=inputs.dt_s, steps=inputs.future_steps,
                )[:, 0]  # fmt: skip
                answer = to_target(truth - batch.pose[:, None, :2], batch.pose[:, 2]) / self._unit_m
                yield model_inputs(batch, self._unit_m), answer.astype(np.float32)

    def _one(self, task: ForecastTask) -> Forecast:
        tracks = task.scene.tracks
        where = f"{self.name}, scene {task.scene.scene_id!r}"
        if len(task.agent_index) == 0:
            return Forecast(np.zeros((0, 1, task.future_steps, 2)), np.zeros((0, 1)))
        for index in task.agent_index:
            if not tracks.valid[index, -1]:
                raise InputError(f"{where}: agent {tracks.agent_id[index]!r} is not known at t0")
        batch = self._batch(task)
        modes, chance = checked_modes(self._model(model_inputs(batch, self._unit_m)), len(batch), where=where)
        if modes.shape[2] != self._inputs.future_steps:
            raise InputError(f"{where}: the model gave {modes.shape[2]} steps, not {self._inputs.future_steps}")
        path = to_scene((modes * self._unit_m).astype(np.float32), batch.pose)
        far = float(np.linalg.norm(modes[:, :, 0] * self._unit_m, axis=-1).max())
        if far > LARGEST_JUMP_M * max(1.0, self._inputs.dt_s):
            raise InputError(f"{where}: the first step lies {far:.0f} m from the driver; is the frame or unit another?")
        steps = path_at(
            path, batch.pose[:, :2], dt_s=self._inputs.dt_s, wanted_dt_s=tracks.dt_s, steps=task.future_steps
        )
        return Forecast(steps.astype(np.float32), chance.astype(np.float32))

    def _batch(self, task: ForecastTask) -> Batch:
        history = history_at(task.scene, dt_s=self._inputs.dt_s, steps=self._inputs.history_steps)
        if not self._road:
            history = replace(history, road=None, signals=None)
        sink = MemorySink(self._inputs)
        rows = add_window(StoreBuilder(sink), self._cutter, history, task.agent_index, self._inputs)
        sink.append("sample", rows)
        return gather(sink.store(), np.arange(len(rows)), self._inputs)


def model_inputs(batch: Batch, unit_m: float) -> dict[str, np.ndarray]:
    """What a model is given, float32, lengths in units of `unit_m` metres; each driver at the origin, heading +x.

    `agent (N, A, H, 7)`: x, y, vx, vy, cos and sin of the heading, seen (agent 0 is the driver); `agent_attribute
    (N, A, 11)`: length, width, is the driver, one-hot `AgentKind`; `agent_valid (N, A)`; `piece (N, P, points, 2)`:
    pieces of lanes; `piece_attribute`, `piece_valid (N, P)` as in `batching.Batch`.
    """
    arrays = {name: np.array(getattr(batch, name)) for name in INPUTS}
    arrays["agent"][..., :4] /= unit_m
    arrays["agent_attribute"][..., :2] /= unit_m
    arrays["piece"] /= unit_m
    for scaled in (slice(0, 2), slice(6, 8)):  # width and limit of the lane; where the stop line is
        arrays["piece_attribute"][..., scaled] /= unit_m
    return arrays


def checked_modes(
    answer: Any, drivers: int, *, where: str
) -> tuple[Float64[np.ndarray, "driver mode step 2"], Float64[np.ndarray, "driver mode"]]:
    """(modes, probabilities) of what a foreign model gave; InputError saying what is wrong with it."""
    modes, chance = answer if isinstance(answer, tuple | list) and len(answer) == 2 else (answer, None)
    modes = np.asarray(modes, np.float64)
    if modes.ndim == 3:
        modes = modes[:, None]
    if modes.ndim != 4 or modes.shape[0] != drivers or modes.shape[1] < 1 or modes.shape[3] != 2:
        raise InputError(f"{where}: expected modes of shape ({drivers}, modes, steps, 2), got {modes.shape}")
    chance = np.full(modes.shape[:2], 1.0) if chance is None else np.asarray(chance, np.float64)
    if chance.shape != modes.shape[:2]:
        raise InputError(f"{where}: expected probabilities of shape {modes.shape[:2]}, got {chance.shape}")
    if not (np.isfinite(modes).all() and np.isfinite(chance).all()):
        raise InputError(f"{where}: the model's answer holds NaN or infinity")
    total = chance.sum(axis=1, keepdims=True)
    if chance.min() < 0 or total.min() <= 0:
        raise InputError(f"{where}: probabilities must be >= 0 and not all 0; are these logits? Apply softmax first")
    return modes, chance / total
