"""Which behaviours are calibrated, within which human limits, and where the search starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.style import STYLE_CLASSES
from stylesim.styles import COMFORT, MOTORWAY, OTHER

# How much faster than the limit a class wishes to go at most. Chosen: about 10 % is common, a third is rare and bold.
LARGEST_SPEED_FACTOR = dict(zip(STYLE_CLASSES, (1.30, 1.35, 1.30, 1.0, 0.95, 1.1), strict=True))


@dataclass(frozen=True)
class Behaviour:
    """One searched number: a driver parameter (or the comfortable speed) between two human limits, in log space."""

    name: str
    low: float
    high: float
    width: float = 1.0  # of the search relative to the others: a speed is felt at a few percent, a gap at a fifth


# The limits are those of agents/styles.yaml where that table has them; a lower limit of 0 is replaced by the smallest
# value that still differs from it on the road [ours].
BEHAVIOURS = (
    Behaviour(COMFORT, 8.0, 46.0, 0.3),
    Behaviour("time_headway_s", 0.8, 4.5),
    Behaviour("max_acceleration_mps2", 0.8, 4.0),
    Behaviour("pedal_noise_mps2", 0.02, 1.3),
    Behaviour("lane_wander_m", 0.03, 0.7),
    Behaviour("lane_change_eagerness", 0.05, 6.0),
    Behaviour("flow_share", 0.02, 0.9),
    Behaviour("flow_speed_factor", 0.7, 1.4, 0.3),
)
LOW = np.log([b.low for b in BEHAVIOURS])
HIGH = np.log([b.high for b in BEHAVIOURS])
WIDTH = np.array([b.width for b in BEHAVIOURS])

# Made by hand from the signs of the TDBM matrix (REFERENCE section 1) and a few trials: aggressive drivers are jerky
# and fast, reckless ones fastest with a wide wander, threatening ones fast, smooth and centred, careful ones slow with
# some wander, cautious ones slow and very smooth with a far gap, timid ones a little faster with the farthest gap.
_START = {
    MOTORWAY: {
        COMFORT: (37.5, 44.5, 37.0, 31.0, 31.0, 35.0),
        "time_headway_s": (0.9, 1.6, 0.9, 1.9, 2.6, 3.0),
        "max_acceleration_mps2": (3.2, 2.2, 2.4, 1.6, 1.3, 1.8),
        "pedal_noise_mps2": (1.2, 0.45, 0.1, 0.3, 0.03, 0.6),
        "lane_wander_m": (0.48, 0.62, 0.22, 0.25, 0.1, 0.04),
        "lane_change_eagerness": (5.0, 5.0, 5.0, 0.1, 0.1, 0.15),
        "flow_share": (0.02, 0.02, 0.4, 0.7, 0.7, 0.3),
        "flow_speed_factor": (1.15, 1.2, 1.22, 0.96, 0.97, 1.06),
    },
    OTHER: {
        COMFORT: (18.5, 21.0, 18.5, 13.0, 12.5, 16.0),
        "time_headway_s": (0.9, 1.3, 0.9, 1.6, 2.2, 3.0),
        "max_acceleration_mps2": (3.2, 2.4, 2.4, 1.6, 1.3, 1.6),
        "pedal_noise_mps2": (1.2, 0.25, 0.1, 0.25, 0.03, 0.55),
        "lane_wander_m": (0.5, 0.65, 0.24, 0.26, 0.1, 0.04),
        "lane_change_eagerness": (5.0, 4.0, 5.0, 0.2, 0.1, 0.15),
        "flow_share": (0.02, 0.02, 0.3, 0.4, 0.4, 0.1),
        "flow_speed_factor": (1.15, 1.2, 1.22, 0.96, 0.97, 1.06),
    },
}


def start(road: str) -> Float64[np.ndarray, "style behaviour"]:
    """The log of each behaviour of each class where the search begins, within the limits."""
    table = np.array([_START[road][behaviour.name] for behaviour in BEHAVIOURS]).T
    return np.clip(np.log(table), LOW, HIGH)
