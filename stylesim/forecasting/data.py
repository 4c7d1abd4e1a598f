"""Batches of samples for training: whole index batches, weighted, seeded by epoch and rank."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int64
from torch import Tensor

from stylesim.errors import InputError
from stylesim.forecasting.batching import gather, to_target
from stylesim.forecasting.conditioner import StyleCond
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.intentions import intentions
from stylesim.forecasting.neighbours import neighbour_futures, sample_of_agent
from stylesim.forecasting.snapshot import STATE_VX
from stylesim.forecasting.store import SampleStore
from stylesim.forecasting.tensors import TensorBatch
from stylesim.randomness import stream


@dataclass(frozen=True, eq=False)
class Example:
    """Inputs, style and target of one batch."""

    inputs: TensorBatch
    style: Tensor  # [batch 3] (z, k, c), or [batch number]
    future_m: Float[Tensor, "batch time 2"]  # frame of the target at t0
    group: Int64[Tensor, " batch"] | None = None  # what the sample counts for; never an input
    neighbour_m: Float[Tensor, "batch agent time 2"] | None = None  # futures around, for dense prediction


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Compiled samples with their `style_cond`.

    `sampling`: weights of the training samples in place of the corpus's. `group`: a number per sample (`groups`).
    """

    store: SampleStore
    style: StyleCond  # one row per sample
    config: InputConfig
    sampling: Float64[np.ndarray, " train"] | None = None
    group: Int64[np.ndarray, " sample"] | None = None
    needed: tuple[str, ...] = ("train", "val")
    dense: bool = False  # give the futures of the agents around too

    def __post_init__(self) -> None:
        """Refuse data without training or validation samples."""
        for number, name in enumerate(self.needed):
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
        InputError where they leave out all, or are no weights. `sampling` takes their place.
        """
        if self.sampling is not None:
            return self.sampling
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
        index = self.split(0)
        order = drawn(index, self.weight, len(index), stream(seed, epoch, "", "sampler"))
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
            None if self.group is None else torch.from_numpy(self.group[index]).to(device),
            torch.from_numpy(neighbour_futures(self.store, batch, self._asked)).to(device) if self.dense else None,
        )

    @cached_property
    def _asked(self) -> Int64[np.ndarray, " agent"]:
        return sample_of_agent(self.store)

    def examples(self, batches: list[Int64[np.ndarray, " batch"]], device: torch.device) -> Iterator[Example]:
        """The batches one after the other."""
        return (self.example(index, device) for index in batches)

    @property
    def parts(self) -> tuple[TrainingData, ...]:
        """What the samples are drawn from: this alone."""
        return (self,)

    def with_parts(self, parts: Sequence[TrainingData]) -> TrainingData:
        """The same with other sampling weights or groups."""
        (only,) = parts
        return only

    @property
    def drawn_share(self) -> tuple[float, ...]:
        """How much of the draws comes from each of the parts."""
        return (1.0,)

    def intentions(self, queries: int, *, seed: int) -> Float32[np.ndarray, "band query 2"]:
        """The intentions of the training samples."""
        velocity, end = self.ends(self.split(0))
        horizon_s = self.config.future_steps * self.config.dt_s
        rng = stream(seed, 0, "", "intentions")
        return intentions(velocity, end, horizon_s=horizon_s, queries=queries, rng=rng)

    def ends(
        self, index: Int64[np.ndarray, " sample"]
    ) -> tuple[Float32[np.ndarray, "sample 2"], Float32[np.ndarray, "sample 2"]]:
        """Velocity at t0 and place at the end of the future of samples, in the frame of each at t0."""
        agent = self.store.sample[index, 1]
        pose = self.store.agent_pose[agent]
        velocity = to_target(self.store.agent_state[agent, -1, STATE_VX : STATE_VX + 2], pose[:, 2])
        return velocity, to_target(self.store.future_m[index, -1] - pose[:, :2], pose[:, 2])


def drawn(
    index: Int64[np.ndarray, " row"], weight: Float64[np.ndarray, " row"], count: int, rng: np.random.Generator
) -> Int64[np.ndarray, " draw"]:
    """`count` of the samples: with equal weights each as often as any other (within one), else by weight."""
    if (weight == weight[0]).all():
        rounds = [rng.permutation(index) for _ in range(-(-count // len(index)))]
        return np.concatenate(rounds)[:count] if rounds else index[:0]
    return rng.choice(index, count, p=weight / weight.sum())
