"""Drivers in highway-env who choose their speed by the traffic around: see `simulation.flow`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from stylesim.simulation.flow import ADAPTS_S, flow_speed, wished_speed

LOOKS_EVERY_S = 1.0  # people look around about that often; the same in the other simulator


def look_around(cars: Sequence[Any]) -> None:
    """Adapt `flow_ratio` (wished speed by the free wish) of every styled car whose style looks at others."""
    if not any(car.style.flow_share > 0.0 for car in cars if getattr(car, "style", None) is not None):
        return
    drivers = [car for car in cars if getattr(car, "style", None) is not None]
    heading = np.array([car.heading for car in drivers])
    own = np.array([car.free_wish_mps for car in drivers])
    around = flow_speed(
        np.array([car.position for car in drivers]),
        np.stack([np.cos(heading), np.sin(heading)], axis=1),
        np.array([car.speed for car in drivers]),
        own,
    )
    wish = wished_speed(
        own,
        around,
        share=np.array([car.style.flow_share for car in drivers]),
        factor=np.array([car.style.flow_speed_factor for car in drivers]),
    )
    keep = math.exp(-LOOKS_EVERY_S / ADAPTS_S)
    for car, ratio in zip(drivers, (wish / own).tolist(), strict=True):
        if car.style.flow_share > 0.0:
            car.flow_ratio = keep * car.flow_ratio + (1.0 - keep) * ratio
