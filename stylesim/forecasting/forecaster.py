"""`TrainedForecaster`: a trained network that answers `ForecastTask`s."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float32, Int64

from stylesim.errors import InputError, unknown
from stylesim.forecast import Forecast, ForecastTask
from stylesim.forecasting.batching import gather, to_scene
from stylesim.forecasting.conditioner import StyleCond, StyleConditioner
from stylesim.forecasting.conditioning import NULL
from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.marginal import MARGINAL, NO_STYLE, averaged
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.samples import RoadCutter, add_window
from stylesim.forecasting.store import MemorySink, SampleStore, StoreBuilder
from stylesim.forecasting.tensors import TensorBatch
from stylesim.forecasting.truth import TrueStyles, Truth, looked_up
from stylesim.scene import Scene

BATCH_DRIVERS = 64  # drivers per forward pass; chosen: more did not make it faster on two cores
DT_TOLERANCE_S = 1e-6


class TrainedForecaster:
    """Forecasts by a network; `conditioner` is None where it was trained without style."""

    def __init__(self, name: str, network: ForecastNetwork, conditioner: StyleConditioner | None) -> None:
        if (conditioner is None) != (not network.config.styled):
            raise ValueError("a network with a style embedding needs a conditioner, and only such a one")
        self.name = name
        self.network = network.eval()
        self.conditioner = conditioner
        self.training_curve: tuple[Mapping[str, float], ...] = ()  # one record per epoch, where the folder has them
        self._cutter = RoadCutter(network.config.inputs)
        self._truth: TrueStyles = {}  # for an oracle

    @property
    def config(self) -> ModelConfig:
        """The configuration of the network."""
        return self.network.config

    @property
    def horizon_s(self) -> float:
        """How far it can look, in seconds."""
        return self.config.inputs.future_steps * self.config.inputs.dt_s

    @property
    def styles(self) -> tuple[str, ...]:
        """The styles that `predict(style=...)` knows; () for a model without style."""
        return () if self.conditioner is None else self.conditioner.classes

    @property
    def earlier_s(self) -> float:
        """How many seconds before the history it would like to see (`ForecastTask.earlier`)."""
        return 0.0 if self.conditioner is None else self.conditioner.earlier_s

    @property
    def sees_future(self) -> bool:
        """True for an oracle, which must be told the truth (`reveal`): for benchmarks only."""
        return self.conditioner is not None and self.conditioner.kind.sees_future

    def reveal(self, scenes: Iterable[Scene]) -> None:
        """Tell an oracle the true styles in these scenes: the commanded ones, else the classes of whole tracks.

        InputError for any other model: nothing but the oracle may see the future.
        """
        if self.conditioner is None or not self.sees_future:
            raise InputError(f"{self.name} is no oracle; it must not be told the true styles")
        judges = self.conditioner.judges
        self._truth = {**self._truth, **Truth(judges, judges.classes, commanded=True).of_scenes(scenes)}

    def predict(self, tasks: Sequence[ForecastTask], style: str | None = None) -> list[Forecast]:
        """Modes for every task, in the frame of its scene.

        The style comes from each driver's history. `style` overrides it: the name of a class asks what everyone
        would do if he were of that class, "none" asks without any style, and "marginal" averages over the classes,
        each as likely as the history says. InputError for tasks of another time step, a longer future than the model
        was trained for, an agent that is not known at t0, or a style that the model does not know.
        """
        for task in tasks:
            self._check(task)
        if self.known_style(style) == MARGINAL:
            return self._marginal(tasks)
        return self.predict_given(tasks, [self.style_cond(task, style) for task in tasks])

    def style_cond(self, task: ForecastTask, style: str | None = None) -> StyleCond:
        """What the network is told of each driver of a task: cells (z, k, c) or vectors; see `predict` for `style`.

        InputError for a style that the model does not know, and for an oracle that has not been told the truth.
        """
        self.known_style(style)
        if self.conditioner is None:
            return np.full((len(task.agent_index), 3), NULL, np.int64)
        if style == NO_STYLE:
            assert self.network.style is not None
            return self.network.style.unknown(len(task.agent_index), torch.device("cpu")).numpy()
        truth = None
        if self.sees_future and style is None:
            truth = looked_up(self._truth, task.scene, task.agent_index)
        return self.conditioner.style_cond(task.scene, task.agent_index, style=style, earlier=task.earlier, truth=truth)

    def known_style(self, style: str | None) -> str | None:
        """`style`, where `predict` can be asked with it; InputError where not."""
        if style in (None, NO_STYLE):
            return style
        if self.conditioner is None:
            raise InputError(f"{self.name} was trained without style; it cannot answer style={style!r}")
        if style not in (*self.styles, MARGINAL):
            raise unknown("style", str(style), (*self.styles, NO_STYLE, MARGINAL))
        return style

    def _marginal(self, tasks: Sequence[ForecastTask]) -> list[Forecast]:
        assert self.conditioner is not None
        asked = [self.conditioner.what_ifs(t.scene, t.agent_index, earlier=t.earlier) for t in tasks]
        by_style = [self.predict_given(tasks, [cond[z] for cond, _ in asked]) for z in range(len(self.styles))]
        count, apart_m = self.config.modes, self.config.nms_m
        return [
            averaged([answers[i] for answers in by_style], weight, count=count, apart_m=apart_m)
            for i, (_, weight) in enumerate(asked)
        ]

    def contexts(self, task: ForecastTask) -> Int64[np.ndarray, " driver"]:
        """The road context of each driver, as the labellers see it in the history: 0 elsewhere, 1 highway."""
        if self.conditioner is None:
            return np.zeros(len(task.agent_index), np.int64)
        return self.conditioner.judges.measure(task.scene, task.agent_index).highway

    def predict_given(self, tasks: Sequence[ForecastTask], cond: Sequence[StyleCond]) -> list[Forecast]:
        """As `predict`, the style being what `cond` says of the drivers of each task (rows as of `style_cond`)."""
        for task, given in zip(tasks, cond, strict=True):
            self._check(task)
            if len(given) != len(task.agent_index):
                raise InputError(f"{len(given)} styles were given for {len(task.agent_index)} drivers of a task")
        if not tasks:
            return []
        sink = MemorySink(self.config.inputs)
        builder = StoreBuilder(sink)
        rows = [add_window(builder, self._cutter, t.scene, t.agent_index, self.config.inputs) for t in tasks]
        sink.append("sample", np.concatenate(rows))
        path, probability = self._modes(sink.store(), np.concatenate(list(cond)))
        result, start = [], 0
        for task in tasks:
            stop = start + len(task.agent_index)
            result.append(Forecast(path[start:stop, :, : task.future_steps], probability[start:stop]))
            start = stop
        return result

    def _check(self, task: ForecastTask) -> None:
        inputs, tracks = self.config.inputs, task.scene.tracks
        where = f"scene {task.scene.scene_id!r}"
        if abs(tracks.dt_s - inputs.dt_s) > DT_TOLERANCE_S:
            raise InputError(f"{where}: steps of {tracks.dt_s} s, but {self.name} was trained on {inputs.dt_s} s")
        if task.future_steps > inputs.future_steps:
            raise InputError(
                f"{where}: {task.future_steps} future steps asked, but {self.name} was trained for "
                f"{inputs.future_steps}; train with a longer future_s"
            )
        for index in task.agent_index:
            if not tracks.valid[index, -1]:
                raise InputError(
                    f"{where}: agent {tracks.agent_id[index]!r} is not known at t0 (frame {task.t0_frame}); "
                    "choose the agents with windows.target_agents"
                )

    def _modes(
        self, store: SampleStore, cond: StyleCond
    ) -> tuple[Float32[np.ndarray, "sample mode time 2"], Float32[np.ndarray, "sample mode"]]:
        config = self.config
        device = next(self.network.parameters()).device
        paths = [np.zeros((0, config.modes, config.inputs.future_steps, 2), np.float32)]
        chances = [np.zeros((0, config.modes), np.float32)]
        if self.network.training:  # asked first, since to set it costs a millisecond
            self.network.eval()
        with torch.inference_mode():
            for index in np.split(np.arange(len(store)), range(BATCH_DRIVERS, len(store), BATCH_DRIVERS)):
                batch = gather(store, index, config.inputs)
                style = torch.from_numpy(cond[index]).to(device)
                path, chance = self.network.predict(TensorBatch.of(batch, device), style)
                paths.append(to_scene(path.cpu().numpy(), batch.pose))
                chances.append(chance.cpu().numpy())
        return np.concatenate(paths), np.concatenate(chances)
