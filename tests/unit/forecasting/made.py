"""What the forecasting tests are made of: judges without labellers, untrained forecasters, a corpus with splits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.forecast import ForecastTask
from stylesim.forecasting.conditioner import StyleConditioner
from stylesim.forecasting.conditioning import StyleCells
from stylesim.forecasting.config import InputConfig, model_config
from stylesim.forecasting.forecaster import TrainedForecaster
from stylesim.forecasting.measured import Measured
from stylesim.forecasting.model import ForecastNetwork
from stylesim.labels import UNDETERMINED, LabelFlag, StyleLabels
from stylesim.scene import Scene
from stylesim.style import STYLE_CLASSES
from stylesim.windows import WindowSpec, target_agents
from tests.conftest import make_scene

SPEC = WindowSpec(history_s=2.0, future_s=3.0, stride_s=1.5)
INPUTS = InputConfig.of(SPEC, 0.1)
SMALL = {"width": 16, "queries": 8, "encoder_layers": 1, "decoder_layers": 2}


class SpeedJudges:
    """Calls the faster half of drivers "fast": enough to test everything but the labellers themselves."""

    classes = ("fast", "slow")

    def measure(self, history: Scene, agent_index: np.ndarray) -> Measured:
        speed = history.tracks.speed_mps[agent_index].astype(np.float64)
        mean, spread = np.nanmean(speed, axis=1), np.nanvar(speed, axis=1)
        style = np.where(mean > 11.0, 0, 1)
        feature = np.stack([spread, mean, np.abs(mean - 11.0), spread + mean], axis=1)
        return Measured(style.astype(np.int64), feature, (mean > 12.5).astype(np.int64))

    def to_dict(self) -> Mapping[str, Any]:
        return {}


def conditioner(judges: Any = None, *, seed: int = 0) -> StyleConditioner:
    """Cells fitted on a few hundred made-up drivers, all of them filled."""
    rng = np.random.default_rng(seed)
    measured = Measured(rng.integers(0, 2, 800), rng.uniform(0, 15, (800, 4)), rng.integers(0, 2, 800))
    cells = StyleCells.fit(measured, SpeedJudges.classes, clusters=3, contexts=2, rng=rng)
    return StyleConditioner("tdbm", judges or SpeedJudges(), cells)


def untrained(*, styled: bool = False, seed: int = 0, **changes: Any) -> TrainedForecaster:
    """A forecaster with random weights and intentions; every output moves with every input."""
    torch.manual_seed(seed)
    config = model_config("tiny", INPUTS, **{**SMALL, "styles": 2 if styled else 0, **changes})
    network = ForecastNetwork(config)
    network.intention_mps2.normal_(0.0, 2.0)
    return TrainedForecaster("untrained", network, conditioner() if styled else None)


def task_of(scene: Scene, t0: int, spec: WindowSpec = SPEC) -> ForecastTask:
    """The task of everyone who can be asked for at t0."""
    history, future, _ = spec.steps(scene.tracks.dt_s)
    targets = target_agents(scene, t0, spec)
    return ForecastTask(scene.history(t0, history), targets, future, t0)


def made_corpus(folder: Path, *, scenes: int = 6, n_frames: int = 90, n_agents: int = 5) -> Corpus:
    """Scenes of the common factory; the last third is for validation."""
    with CorpusWriter(folder, source="made", configuration={}) as writer:
        for number in range(scenes):
            scene = make_scene(f"scene-{number}", n_agents=n_agents, n_frames=n_frames, seed=number)
            writer.add(scene, split="train" if number < scenes * 2 // 3 else "val")
        return writer.finish()


def with_style_labels(corpus: Corpus, rare: str = "car-0") -> Corpus:
    """Track labels beside a corpus: the driver named `rare` is aggressive, car-1 unknown, the others are careful."""
    rows = [(scene.scene_id, agent) for scene in corpus for agent in scene.tracks.agent_id]
    style = [UNDETERMINED if agent == "car-1" else 0 if agent == rare else 3 for _, agent in rows]
    n = len(rows)
    corpus.write_labels(
        [
            StyleLabels(
                method="tdbm",
                span="track",
                classes=STYLE_CLASSES,
                feature_names=("speed",),
                scene_id=tuple(scene for scene, _ in rows),
                agent_id=tuple(agent for _, agent in rows),
                start_frame=np.zeros(n, np.int32),
                stop_frame=np.full(n, 90, np.int32),
                score=np.zeros((n, len(STYLE_CLASSES)), np.float32),
                style=np.array(style, np.int8),
                margin=np.zeros(n, np.float32),
                aggressiveness=np.zeros(n, np.float32),
                feature=np.zeros((n, 1), np.float32),
                missing=np.zeros((n, 1), bool),
                flags=np.array([LabelFlag.HIGHWAY if agent == "car-2" else 0 for _, agent in rows], np.int32),
            )
        ]
    )
    return corpus


def weights(model: TrainedForecaster) -> dict[str, bytes]:
    """The network's weights, to the bit."""
    return {key: value.numpy().tobytes() for key, value in model.network.state_dict().items()}
