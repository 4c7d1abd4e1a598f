"""Training on two sources at once: a fixed share of every batch comes from added (generated) samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeAlias, TypeVar, cast

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor

from stylesim.errors import InputError
from stylesim.forecasting.config import InputConfig
from stylesim.forecasting.data import Example, TrainingData, drawn
from stylesim.forecasting.intentions import intentions
from stylesim.randomness import stream

Joinable = TypeVar("Joinable")


@dataclass(frozen=True, eq=False)
class MixedData:
    """`base` with the share `share` of its draws replaced by draws from `added`.

    An epoch is as long as one of `base` alone, so that trainings of any share take equally many gradient steps.
    Validation samples are those of `base`. Samples of `added` are numbered after all of `base`.
    """

    base: TrainingData
    added: TrainingData
    share: float

    def __post_init__(self) -> None:
        """Refuse a share that is none."""
        if not 0 <= self.share <= 1:
            raise InputError(f"augment_share must be between 0 and 1, not {self.share}")

    @property
    def config(self) -> InputConfig:
        """The inputs, alike for both."""
        return self.base.config

    @property
    def parts(self) -> tuple[TrainingData, ...]:
        """What the samples are drawn from."""
        return self.base, self.added

    def with_parts(self, parts: Sequence[TrainingData]) -> MixedData:
        """The same with other sampling weights or groups."""
        base, added = parts
        return MixedData(base, added, self.share)

    @property
    def drawn_share(self) -> tuple[float, ...]:
        """How much of the draws comes from each of the parts."""
        return 1.0 - self.share, self.share

    @property
    def without_weight(self) -> int:
        """How many training samples have no weight although their corpus has weights."""
        return sum(part.without_weight for part in self.parts)

    def split(self, number: int) -> Int64[np.ndarray, " sample"]:
        """The samples of split 0 (train, of both) or 1 (val, of `base`)."""
        mine = self.base.split(number)
        return np.concatenate([mine, len(self.base.store) + self.added.split(0)]) if number == 0 else mine

    def epoch(
        self, epoch: int, *, seed: int, batch_size: int, rank: int = 0, world: int = 1
    ) -> list[Int64[np.ndarray, " batch"]]:
        """As many index batches as `base` alone gives, each with its share of both (within one sample)."""
        index, more = self.base.split(0), self.added.split(0)
        size = min(batch_size, len(index))
        edge = np.floor(np.arange(len(index) // size + 1) * size * self.share + 1e-9).astype(np.int64)
        count = np.diff(edge)  # of added samples, per batch
        extra = int(edge[-1])
        rng = stream(seed, epoch, "", "sampler")
        mine = drawn(index, self.base.weight, len(count) * size - extra, rng)
        theirs = drawn(more, self.added.weight, extra, stream(seed, epoch, "", "sampler of added"))
        own_edge = np.arange(len(edge)) * size - edge
        batches = [
            np.concatenate([mine[own_edge[i] : own_edge[i + 1]], len(self.base.store) + theirs[edge[i] : edge[i + 1]]])
            for i in range(len(count))
        ]
        return batches[rank::world]

    def example(self, index: Int64[np.ndarray, " batch"], device: torch.device) -> Example:
        """One batch on a device; the samples of `base` come first."""
        first = len(self.base.store)
        mine, theirs = index[index < first], index[index >= first] - first
        if not len(theirs):
            return self.base.example(mine, device)
        if not len(mine):
            return self.added.example(theirs, device)
        return joined(self.base.example(mine, device), self.added.example(theirs, device))

    def examples(self, batches: list[Int64[np.ndarray, " batch"]], device: torch.device) -> Iterator[Example]:
        """The batches one after the other."""
        return (self.example(index, device) for index in batches)

    def intentions(self, queries: int, *, seed: int) -> Float32[np.ndarray, "band query 2"]:
        """The intentions of as many training samples as `base` has, of both by their shares."""
        index, more = self.base.split(0), self.added.split(0)
        count = round(self.share * len(index))
        rng = stream(seed, 0, "", "samples for intentions")
        mine = drawn(index, np.ones(len(index)), len(index) - count, rng)
        theirs = drawn(more, np.ones(len(more)), count, rng)
        points = zip(self.base.ends(mine), self.added.ends(theirs), strict=True)
        velocity, end = (np.concatenate(pair) for pair in points)
        horizon_s = self.config.future_steps * self.config.dt_s
        return intentions(velocity, end, horizon_s=horizon_s, queries=queries, rng=stream(seed, 0, "", "intentions"))


TrainingSet: TypeAlias = TrainingData | MixedData


def joined(first: Joinable, second: Joinable) -> Joinable:
    """Two batches as one: tensors one after the other, in every field of a dataclass of them."""
    if first is None:
        return first
    if isinstance(first, Tensor):
        return cast(Joinable, torch.cat([first, cast(Tensor, second)]))
    names = [field.name for field in fields(first)]  # type: ignore[arg-type]
    return replace(first, **{name: joined(getattr(first, name), getattr(second, name)) for name in names})  # type: ignore[type-var]
