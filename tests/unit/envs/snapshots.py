"""Made snapshots."""

from __future__ import annotations

from typing import Any

import numpy as np

from stylesim.envs.world import EgoState, Snapshot


def made_snapshot(
    others: list[tuple[float, ...]], *, heading_rad: float = 0.0, speed: float = 10.0, **ego: Any
) -> Snapshot:
    """An ego at (100, 50) and others (x, y, vx, vy, heading), each a car of 4 x 2 m."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    rows = [(100.0, 50.0, speed * c, speed * s, heading_rad, 5.0, 1.8), *((*other, 4.0, 2.0) for other in others)]
    n = len(rows)
    return Snapshot(
        ego=EgoState(speed_mps=speed, speed_limit_mps=15.0, **ego),
        number=np.arange(n, dtype=np.int32),
        pose=np.array(rows, np.float64),
        style=np.array([-1, *((i % 6) for i in range(n - 1))], np.int8),
        knob=np.linspace(0, 1, n, dtype=np.float32),
        decision=np.array([i % 3 for i in range(n)], np.int8),
        ran_red=np.arange(n) == 1,
        crashed=np.arange(n) == 2,
        lights=np.array([2, 4], np.int8),
    )
