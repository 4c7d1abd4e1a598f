"""Where training runs: plainly on the CPU, or through Lightning Fabric on accelerators, which saves code there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, Protocol, cast, runtime_checkable

import torch
from torch import Tensor, nn

from stylesim.errors import InputError, MissingDependencyError, unknown
from stylesim.forecasting.head import Modes
from stylesim.forecasting.tensors import TensorBatch

ACCELERATORS = ("auto", "cpu", "gpu")
PRECISIONS = ("32-true", "bf16-mixed")  # weights stay float32: what is saved and validated is the same network

Forward = Callable[..., list[Modes]]


@runtime_checkable
class Runtime(Protocol):
    """The little that the training loop needs to know of where it runs."""

    device: torch.device

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Forward, Any]:
        """What to call in place of the network, and the optimizer to train with."""
        ...

    def backward(self, loss: Tensor) -> None:
        """Compute gradients."""
        ...


class PlainRuntime:
    """One CPU process."""

    device = torch.device("cpu")

    def __init__(self, *, compiled: bool = False) -> None:
        self._compiled = compiled

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Forward, Any]:
        """Both as they are, or the network compiled."""
        return (_calling(_compiled(_OfTensors(network))) if self._compiled else network), optimizer

    def backward(self, loss: Tensor) -> None:
        """Compute gradients."""
        loss.backward()  # type: ignore[no-untyped-call]


class FabricRuntime:
    """One device, in a precision that Lightning Fabric knows."""

    def __init__(self, *, accelerator: str, precision: str, compiled: bool = False) -> None:
        try:
            from lightning_fabric import Fabric
        except ImportError:
            raise MissingDependencyError(
                "training on a GPU, or in another precision, needs lightning-fabric: pip install 'stylesim[train]'"
            ) from None
        self.fabric = Fabric(accelerator=accelerator, devices=1, precision=precision)  # type: ignore[arg-type]
        self.fabric.launch()
        self.device = self.fabric.device
        self._compiled = compiled

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Forward, Any]:
        """Both moved to the device and wrapped."""
        plain: nn.Module = _OfTensors(network)
        wrapped, optimizer = self.fabric.setup(_compiled(plain) if self._compiled else plain, optimizer)
        return _calling(wrapped), optimizer

    def backward(self, loss: Tensor) -> None:
        """Compute gradients, scaled where the precision needs it."""
        self.fabric.backward(loss)


class _OfTensors(nn.Module):
    """The network between tuples of tensors: Fabric converts those, and refuses frozen dataclasses."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, inputs: tuple[Tensor, ...], *others: Tensor | None) -> list[tuple[Tensor | None, ...]]:
        """What the network gives, each layer's modes as a tuple."""
        layers: list[Modes] = self.network(TensorBatch(*inputs), *others)
        return [tuple(getattr(modes, field.name) for field in fields(Modes)) for modes in layers]


def _calling(module: Callable[..., Any]) -> Forward:
    """The module of tuples, called as the network is."""

    def forward(batch: TensorBatch, *others: Tensor | None) -> list[Modes]:
        inputs = tuple(getattr(batch, field.name) for field in fields(TensorBatch))
        return [Modes(*layer) for layer in module(inputs, *others)]

    return forward


def _compiled(module: nn.Module) -> nn.Module:
    """The module, compiled at its first call; shapes are fixed, since all batches but the last are of one size."""
    return cast(nn.Module, torch.compile(module, dynamic=False))


def runtime(accelerator: str = "auto", precision: str = "32-true", *, compiled: bool = False) -> Runtime:
    """Where to train: "cpu" needs nothing; "gpu" needs Lightning Fabric; "auto" is the GPU where there is one.

    `precision` is one of PRECISIONS; all but "32-true" need Lightning Fabric on the CPU too. InputError where there is
    no GPU that was asked for.
    """
    if accelerator not in ACCELERATORS:
        raise unknown("accelerator", accelerator, ACCELERATORS)
    if precision not in PRECISIONS:
        raise unknown("precision", precision, PRECISIONS)
    if accelerator == "gpu" and not torch.cuda.is_available():
        raise InputError("no GPU that torch can use is there; take accelerator 'cpu' or 'auto'")
    if accelerator == "cpu" or not torch.cuda.is_available():
        if precision == PRECISIONS[0]:
            return PlainRuntime(compiled=compiled)
        return FabricRuntime(accelerator="cpu", precision=precision, compiled=compiled)
    return FabricRuntime(accelerator="cuda", precision=precision, compiled=compiled)
