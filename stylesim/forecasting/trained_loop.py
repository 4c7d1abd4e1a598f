"""From samples to a trained network: the first model that JTT asks for, the weights of the loss, the loop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch

from stylesim.forecasting.config import ModelConfig
from stylesim.forecasting.devices import Runtime
from stylesim.forecasting.loop import Loop, TrainSettings
from stylesim.forecasting.mixing import TrainingSet
from stylesim.forecasting.model import ForecastNetwork
from stylesim.forecasting.reweighting import identified, loss_weigher
from stylesim.forecasting.robust import RobustSettings
from stylesim.forecasting.samples import Progress
from stylesim.randomness import stream

FIRST_FOLDER = "identification"  # of the first model that JTT trains


def trained_loop(
    config: ModelConfig,
    data: TrainingSet,
    groups: tuple[str, ...],
    settings: TrainSettings,
    robust: RobustSettings,
    *,
    runtime: Runtime,
    folder: Path,
    begin: Callable[[str], Progress | None],
) -> Loop:
    """The loop after its last step, with the samples and the weigher that it had; goes on where `folder` was left.

    `begin` is told what begins and gives what counts for it.
    """
    if "jtt" in robust.methods:
        first, told = _network(config, data, settings.seed), begin("identifying what is hard")
        where = folder / FIRST_FOLDER
        data = identified(data, first, settings, robust, runtime=runtime, folder=where, progress=told)
    weigher = loss_weigher(robust, data, groups)
    network = _network(config, data, settings.seed)
    loop = Loop(network, data, settings, runtime=runtime, folder=folder, weigher=weigher)
    loop.restore()
    loop.run(begin("training"))
    return loop


def _network(config: ModelConfig, data: TrainingSet, seed: int) -> ForecastNetwork:
    """An untrained network with the intentions of the training samples."""
    with torch.random.fork_rng():
        torch.manual_seed(int(stream(seed, 0, "", "weights").integers(2**62)))
        network = ForecastNetwork(config)
    network.intention_mps2.copy_(torch.from_numpy(data.intentions(config.queries, seed=seed)))
    return network
