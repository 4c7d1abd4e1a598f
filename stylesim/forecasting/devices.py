"""Where training runs: plainly on the CPU, or through Lightning Fabric on accelerators, which saves code there."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor, nn

from stylesim.errors import MissingDependencyError, unknown

ACCELERATORS = ("auto", "cpu", "gpu")


@runtime_checkable
class Runtime(Protocol):
    """The little that the training loop needs to know of where it runs."""

    device: torch.device

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Any, Any]:
        """The network and optimizer to train with."""
        ...

    def backward(self, loss: Tensor) -> None:
        """Compute gradients."""
        ...


class PlainRuntime:
    """One CPU process."""

    device = torch.device("cpu")

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Any, Any]:
        """Both as they are."""
        return network, optimizer

    def backward(self, loss: Tensor) -> None:
        """Compute gradients."""
        loss.backward()  # type: ignore[no-untyped-call]


class FabricRuntime:
    """One accelerator, in any precision that Lightning Fabric knows."""

    def __init__(self, *, accelerator: str, precision: str) -> None:
        try:
            from lightning_fabric import Fabric
        except ImportError:
            raise MissingDependencyError(
                "training on a GPU needs lightning-fabric: pip install 'stylesim[train]'"
            ) from None
        self.fabric = Fabric(accelerator=accelerator, devices=1, precision=precision)  # type: ignore[arg-type]
        self.fabric.launch()
        self.device = self.fabric.device

    def setup(self, network: nn.Module, optimizer: torch.optim.Optimizer) -> tuple[Any, Any]:
        """Both moved to the device and wrapped."""
        wrapped: tuple[Any, Any] = self.fabric.setup(network, optimizer)
        return wrapped

    def backward(self, loss: Tensor) -> None:
        """Compute gradients, scaled where the precision needs it."""
        self.fabric.backward(loss)


def runtime(accelerator: str = "auto", precision: str = "32-true") -> Runtime:
    """Where to train: "cpu" needs nothing; "gpu" needs Lightning Fabric; "auto" is the GPU where there is one."""
    if accelerator not in ACCELERATORS:
        raise unknown("accelerator", accelerator, ACCELERATORS)
    if accelerator == "cpu" or (accelerator == "auto" and not torch.cuda.is_available()):
        return PlainRuntime()
    return FabricRuntime(accelerator="cuda", precision=precision)
