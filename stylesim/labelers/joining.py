"""Tracks one after the other in time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int, Shaped

from stylesim.tracks import Tracks


def one_after_another(parts: Sequence[Tracks], keep: Bool[np.ndarray, " agent"]) -> Tracks:
    """The kept agents' frames of all parts in a row, with nothing of how they came about.

    All parts have the same agents and clock.
    """
    index, first = np.flatnonzero(keep), parts[0]
    return Tracks(
        agent_id=tuple(first.agent_id[i] for i in index),
        kind=first.kind[index],
        size_m=first.size_m[index],
        position_m=_joined([part.position_m for part in parts], index),
        velocity_mps=_joined([part.velocity_mps for part in parts], index),
        heading_rad=_joined([part.heading_rad for part in parts], index),
        valid=_joined([part.valid for part in parts], index),
        dt_s=first.dt_s,
        origin_m=first.origin_m,
    )


def _joined(
    parts: Sequence[Shaped[np.ndarray, "agent _ *any"]], index: Int[np.ndarray, " kept"]
) -> Shaped[np.ndarray, "kept time *any"]:
    result = np.concatenate([part[index] for part in parts], axis=1)
    result.flags.writeable = False  # so that `Tracks` takes it without a copy
    return result
