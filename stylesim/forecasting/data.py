"""Batches of samples for training: whole index batches, weighted, seeded by epoch and rank."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int64
from torch import Tensor

from stylesim.errors import InputError
from stylesim.forecasting.batching import gather, to_target
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.intentions import intentions
from stylesim.forecasting.snapshot import STATE_VX
from stylesim.forecasting.store import SampleStore
from stylesim.forecasting.tensors import TensorBatch
from stylesim.randomness import stream


@dataclass(frozen=True, eq=False)
class Example:
    """Inputs, style and target of one batch."""

    inputs: TensorBatch
    style: Tensor  # [batch 3] (z, k, c)
    future_m: Float[Tensor, "batch time 2"]  # frame of the target at t0


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Compiled samples with their `style_cond`."""

    store: SampleStore
    style: Int64[np.ndarray, "sample 3"]
    config: InputConfig

    def __post_init__(self) -> None:
        """Refuse data without training or validation samples."""
        for number, name in enumerate(("train", "val")):
            if not (self.store.origin[:, 3] == number).any():
                raise InputError(
                    f"split {name!r} has no agent with a whole history and future: its scenes are too short or "
                    "empty; use shorter windows, more data, or another `stylesim merge --split`"
                )

    def split(self, number: int) -> Int64[np.ndarray, " sample"]:
        """The samples of split 0 (train) or 1 (val)."""
        return np.flatnonzero(self.store.origin[:, 3] == number)

    @property
    def without_weight(self) -> int:
        """How many training samples have no weight although the corpus has weights."""
        return int(np.isnan(self.store.weight[self.split(0)]).sum())

    @cached_property
    def weight(self) -> Float64[np.ndarray, " train"]:
        """Sampling weight of each training sample.

        Samples that the corpus's weights leave out get the mean of the others, and a warning says how many they are.
        InputError where they leave out all, or are no weights.
        """
        weight = self.store.weight[self.split(0)].astype(np.float64)
        missing = np.isnan(weight)
        advice = "balance the corpus anew (`stylesim balance`), or merge it anew"
        if missing.all():
            raise InputError(f"the corpus has sampling weights, but for none of its {len(weight)} samples; {advice}")
        if missing.any():
            text = f"{missing.sum()} of {len(weight)} training samples have no sampling weight; they get the mean"
            warnings.warn(f"{text}. To have them weighted, {advice}", stacklevel=2)
            weight[missing] = weight[~missing].mean()
        if not (np.isfinite(weight).all() and (weight >= 0).all() and weight.sum() > 0):
            raise InputError(f"sampling weights must be numbers >= 0, not all 0; {advice}")
        return weight

    def epoch(
        self, epoch: int, *, seed: int, batch_size: int, rank: int = 0, world: int = 1
    ) -> list[Int64[np.ndarray, " batch"]]:
        """The index batches of one epoch: as many draws as there are training samples.

        Equal weights: each sample once, in random order. Else: drawn with replacement, by weight, from the training
        split only.
        """
        rng = stream(seed, epoch, "", "sampler")
        index = self.split(0)
        weight = self.weight
        if (weight == weight[0]).all():
            order = rng.permutation(index)
        else:
            order = rng.choice(index, len(index), p=weight / weight.sum())
        batches = np.split(order, range(batch_size, len(order), batch_size))
        if len(batches) > 1 and len(batches[-1]) < batch_size:
            batches = batches[:-1]  # a small last batch would weigh its samples more
        return batches[rank::world]

    def example(self, index: Int64[np.ndarray, " batch"], device: torch.device) -> Example:
        """One batch on a device."""
        batch = gather(self.store, index, self.config)
        future = to_target(self.store.future_m[index] - batch.pose[:, None, :2], batch.pose[:, 2])
        return Example(
            TensorBatch.of(batch, device),
            torch.from_numpy(self.style[index]).to(device),
            torch.from_numpy(future).to(device),
        )

    def examples(self, batches: list[Int64[np.ndarray, " batch"]], device: torch.device) -> Iterator[Example]:
        """The batches one after the other."""
        return (self.example(index, device) for index in batches)

    def intentions(self, queries: int, *, seed: int) -> Float32[np.ndarray, "band query 2"]:
        """The intentions of the training samples."""
        index = self.split(0)
        agent = self.store.sample[index, 1]
        pose = self.store.agent_pose[agent]
        velocity = to_target(self.store.agent_state[agent, -1, STATE_VX : STATE_VX + 2], pose[:, 2])
        end = to_target(self.store.future_m[index, -1] - pose[:, :2], pose[:, 2])
        horizon_s = self.config.future_steps * self.config.dt_s
        rng = stream(seed, 0, "", "intentions")
        return intentions(velocity, end, horizon_s=horizon_s, queries=queries, rng=rng)
