"""Common sizes of road users, for formats that give none. Chosen, so that gaps are right on average."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int

from stylesim.tracks import AgentKind

# A mid-size car, a lorry, a 12 m bus, riders, a person.
NOMINAL_SIZE_M = {
    AgentKind.CAR: (4.6, 1.9),
    AgentKind.TRUCK: (10.0, 2.5),
    AgentKind.BUS: (12.0, 2.55),
    AgentKind.MOTORCYCLE: (2.2, 0.8),
    AgentKind.BICYCLE: (1.8, 0.6),
    AgentKind.PEDESTRIAN: (0.6, 0.6),
    AgentKind.STATIC: (1.0, 1.0),
    AgentKind.OTHER: (1.0, 1.0),
}
_BY_NUMBER = np.array([NOMINAL_SIZE_M[kind] for kind in sorted(NOMINAL_SIZE_M)], np.float64)


def nominal_sizes(kind: Int[np.ndarray, " agent"]) -> Float64[np.ndarray, "agent 2"]:
    """Length and width of each agent by its kind."""
    return _BY_NUMBER[kind]


def completed(
    size_m: Float64[np.ndarray, "agent 2"], kind: Int[np.ndarray, " agent"]
) -> tuple[Float64[np.ndarray, "agent 2"], Bool[np.ndarray, " agent"]]:
    """The sizes with those that are missing (0 or NaN) taken by kind, and which these are."""
    missing = ~(np.isfinite(size_m) & (size_m != 0.0)).all(axis=1)
    return np.where(missing[:, None], nominal_sizes(kind), size_m), missing
