"""How a driver takes a sudden small gap: with a cool head, as long as the leader does not brake."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

COOLNESS = 0.99  # Kesting, Treiber, Helbing 2010 [recalled]


def cool(idm_mps2: float, ego: Any, leader: Any, gap_m: float, *, bold: float, ease: float) -> float:
    """The IDM's acceleration, tempered by the constant-acceleration heuristic.

    Kesting, Treiber, Helbing 2010 [recalled]. The IDM takes a gap that is smaller than wished for an emergency,
    also where a faster car cut in and nothing is at stake; the heuristic asks what is needed if the leader keeps
    its acceleration. `bold` and `ease` are the driver's greatest acceleration and comfortable deceleration, m/s2.
    """
    speed = max(ego.speed, 0.0)
    leader_speed = max(float(np.dot(leader.velocity, ego.direction)), 0.0)
    along = float(np.dot(leader.direction, ego.direction))  # less than 1 for a leader that crosses
    leader_mps2 = min(getattr(leader, "acceleration_mps2", 0.0) * along, bold)
    closing = speed - leader_speed
    if leader_speed * closing <= -2 * gap_m * leader_mps2 and leader_mps2 < 0:
        heuristic = speed**2 * leader_mps2 / (leader_speed**2 - 2 * gap_m * leader_mps2)
    else:
        heuristic = leader_mps2 - max(closing, 0.0) ** 2 / (2 * gap_m)
    if idm_mps2 >= heuristic:
        return idm_mps2
    tempered = heuristic + ease * math.tanh((idm_mps2 - heuristic) / ease)
    return (1 - COOLNESS) * idm_mps2 + COOLNESS * tempered
