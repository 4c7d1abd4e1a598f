"""A long table of boxes laid out by agent and frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64


@dataclass(frozen=True, eq=False)
class Grid:
    """Boxes by agent and frame; the first row of `agent_id` is the vehicle that carried the sensors."""

    agent_id: tuple[str, ...]
    position_m: Float64[np.ndarray, "agent time 2"]
    heading_rad: Float64[np.ndarray, "agent time"]
    size_m: Float64[np.ndarray, "agent time 2"]
    valid: Bool[np.ndarray, "agent time"]
    first_row: Int64[np.ndarray, " agent"]  # row of the table in which the agent is first seen; -1 for the ego
    duplicates: int  # rows left out because one for the same agent and frame came before


def grid_of(
    *,
    agent: Sequence[str] | np.ndarray,
    frame: Int64[np.ndarray, " row"],
    position_m: Float64[np.ndarray, "row 2"],
    heading_rad: Float64[np.ndarray, " row"],
    size_m: Float64[np.ndarray, "row 2"],
    ego_id: str,
    ego_position_m: Float64[np.ndarray, "time 2"],
    ego_heading_rad: Float64[np.ndarray, " time"],
    ego_size_m: tuple[float, float],
    ego_valid: Bool[np.ndarray, " time"],
) -> Grid:
    """The boxes and, in front of them, the ego vehicle. Of two boxes for one agent and frame the first is kept."""
    ids, index = np.unique(np.asarray(agent, str), return_inverse=True)
    shape = (len(ids) + 1, len(ego_valid))
    valid = np.zeros(shape, bool)
    position, size, heading = np.full((*shape, 2), np.nan), np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    at = (index[::-1] + 1, frame[::-1])
    position[at], heading[at], size[at], valid[at] = position_m[::-1], heading_rad[::-1], size_m[::-1], True
    position[0], heading[0], size[0], valid[0] = ego_position_m, ego_heading_rad, ego_size_m, ego_valid
    first = np.full(shape[0], -1)
    order = np.argsort(frame, kind="stable")[::-1]
    first[index[order] + 1] = order
    return Grid(
        agent_id=(ego_id, *(str(i) for i in ids)),
        position_m=position,
        heading_rad=heading,
        size_m=size,
        valid=valid,
        first_row=first,
        duplicates=len(frame) - int(valid[1:].sum()),
    )
