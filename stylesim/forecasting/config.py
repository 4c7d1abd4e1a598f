"""The configuration of the network and of what it sees: one frozen dataclass, plain JSON on disk."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from stylesim.errors import InputError, unknown
from stylesim.windows import WindowSpec

FUSIONS = ("early", "mid", "late")
READINGS = ("R1", "R2", "R3", "R4", "R5")


@dataclass(frozen=True)
class InputConfig:
    """What is cut out of a scene for one sample. REFERENCE section 7: 16 agents, 64 polylines of 10 points."""

    dt_s: float
    history_steps: int
    future_steps: int
    agents: int = 16
    polylines: int = 64
    points: int = 10
    piece_m: float = 20.0  # a lane is cut in pieces no longer than this; chosen: about two car gaps in a city
    ahead_s: float = 1.5  # polylines are the nearest to where the agent will be then; chosen: a quarter of 6 s

    @classmethod
    def of(cls, spec: WindowSpec, dt_s: float, **view: int) -> InputConfig:
        """The input of windows of that spec, at that time step; `view` as in `VIEWS`."""
        history, future, _ = spec.steps(dt_s)
        return cls(dt_s=dt_s, history_steps=history, future_steps=future, **view)


@dataclass(frozen=True)
class ModelConfig:
    """The network. `styles` = 0 and `style_features` = 0: no style embedding; one of the two may be more."""

    inputs: InputConfig
    width: int = 64
    heads: int = 2  # of 32 channels; four of 16 were 1.4 times slower on two cores
    encoder_layers: int = 2
    decoder_layers: int = 2
    queries: int = 16
    modes: int = 6
    patch_steps: int = 5  # history steps that make one token of the history encoder
    dropout: float = 0.05
    nms_m: float = 2.5  # endpoints nearer than this are one mode (MTR's threshold [recalled])
    fusion: str = "early"
    reading: str = "R1"
    rank: int = 4  # of reading R2
    styles: int = 0
    clusters: int = 3
    contexts: int = 2
    style_features: int = 0  # length of the style vector, for conditions of numbers instead of cells
    style_parameters: int = 0  # the style is given at least so many, idle ones included: arms of equal size
    dense: bool = False  # learn the futures of the agents around too
    style_dropout: float = 0.125  # REFERENCE section 4: 10-15 %

    def __post_init__(self) -> None:
        """Refuse what the network cannot be built from."""
        if self.fusion not in FUSIONS:
            raise unknown("fusion", self.fusion, FUSIONS)
        if self.reading not in READINGS:
            raise unknown("reading", self.reading, READINGS)
        if self.width % self.heads:
            raise InputError(f"width {self.width} is not a multiple of heads {self.heads}")
        if self.styles and self.style_features:
            raise InputError("a network is given cells of style or vectors of it, not both")
        if self.modes > self.queries:
            raise InputError(f"{self.modes} modes cannot be chosen from {self.queries} queries")

    @property
    def styled(self) -> bool:
        """True for a network that takes a style."""
        return self.styles > 0 or self.style_features > 0

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return asdict(self)

    @classmethod
    def from_dict(cls, raw: dict[str, Any]) -> ModelConfig:
        """The inverse of `to_dict`; InputError for a key that this version does not know."""
        known = {f.name for f in fields(cls)}
        for key in raw:
            if key not in known:
                raise unknown("model setting", key, known)
        return cls(**{**raw, "inputs": InputConfig(**raw["inputs"])})


# REFERENCE section 7: width 64, 16 queries, 2 + 2 layers is about 0.5 M; width 128, 32 queries, 3 + 2 about 2 M.
# `mini` is for tests and for experiments of many short trainings; chosen: a tenth of tiny's cost.
SIZES: dict[str, dict[str, int]] = {
    "mini": {"width": 32, "heads": 1, "encoder_layers": 1, "decoder_layers": 2, "queries": 12},
    "tiny": {"width": 64, "heads": 2, "encoder_layers": 2, "decoder_layers": 2, "queries": 16},
    "small": {"width": 128, "heads": 4, "encoder_layers": 3, "decoder_layers": 2, "queries": 32},
    "base": {"width": 256, "heads": 8, "encoder_layers": 6, "decoder_layers": 4, "queries": 64},
}


# How much of the scene a size sees, where that is not what `InputConfig` says.
VIEWS: dict[str, dict[str, int]] = {"mini": {"agents": 6, "polylines": 16}}


def model_config(size: str, inputs: InputConfig, **changes: Any) -> ModelConfig:
    """The configuration of a named size; InputError for an unknown one."""
    if size not in SIZES:
        raise unknown("model size", size, SIZES)
    return ModelConfig(inputs=inputs, **{**SIZES[size], **changes})
