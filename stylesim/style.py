"""`DriverStyle`: how one person drives, in physical units, knowing no simulator; and the six classes."""

from __future__ import annotations

from dataclasses import dataclass, fields

STYLE_CLASSES = ("aggressive", "reckless", "threatening", "careful", "cautious", "timid")  # TDBM, most to least

# REFERENCE section 1: the places of the classes on the knob; 0 is the neutral driver.
CLASS_KNOB = {"aggressive": 1.0, "reckless": 0.6, "threatening": 0.2, "careful": -0.2, "cautious": -0.6, "timid": -1.0}

# A class owns the stretch of the knob that is nearer to its place than to any other's.
CLASS_INTERVAL = {name: (max(-1.0, place - 0.2), min(1.0, place + 0.2)) for name, place in CLASS_KNOB.items()}


def class_of_knob(aggressiveness: float) -> str:
    """The class whose place on the knob is nearest; on a border the bolder one. ValueError outside [-1, 1]."""
    if not -1.0 <= aggressiveness <= 1.0:
        raise ValueError(f"aggressiveness must lie in [-1, 1], not {aggressiveness}")
    return min(STYLE_CLASSES, key=lambda name: round(abs(CLASS_KNOB[name] - aggressiveness), 9))


@dataclass(frozen=True)
class DriverStyle:
    """One driver. Every field has its unit in its name and its source in `agents/styles.yaml`.

    `name` is the commanded class of the six (or "neutral"), `aggressiveness` the place on the knob.
    Speeds, gaps and accelerations are wishes; the vehicle and the traffic limit what comes of them.
    """

    name: str
    aggressiveness: float
    desired_speed_factor: float  # wished speed / speed limit
    time_headway_s: float  # wished time gap to the leader
    min_gap_m: float  # gap at standstill
    max_acceleration_mps2: float
    comfortable_deceleration_mps2: float
    reaction_time_s: float
    pedal_noise_mps2: float  # sd of the acceleration noise (Ornstein-Uhlenbeck)
    pedal_noise_time_s: float  # its correlation time
    lane_wander_m: float  # sd of the lateral position in the lane (Ornstein-Uhlenbeck)
    lane_wander_time_s: float  # its correlation time
    lane_change_eagerness: float  # 0 never for speed, 1 an average driver, more: for less gain
    politeness: float  # weight of others' loss in a lane change, 0 to 1 (MOBIL)
    lane_change_duration_s: float
    gap_acceptance_s: float  # time gap that is taken when crossing or merging
    yellow_midpoint_s: float  # time to stop line at which half of such drivers stop
    yellow_slope_per_s: float  # slope of the logistic there
    red_running_s: float  # how long after the onset of red a driver who decided to go still goes
    flow_share: float = 0.0  # how much of the wished speed comes from the traffic around, 0 to 1
    flow_speed_factor: float = 1.0  # that part: wished speed / speed of the slower half of the traffic around

    def __post_init__(self) -> None:
        """Refuse a driver that no simulator could drive."""
        if not -1.0 <= self.aggressiveness <= 1.0:
            raise ValueError(f"aggressiveness must lie in [-1, 1], not {self.aggressiveness}")
        for name in POSITIVE_FIELDS:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} of driver style {self.name!r} must be positive, not {getattr(self, name)}")
        for name in PHYSICAL_FIELDS:
            if not getattr(self, name) >= 0:
                raise ValueError(f"{name} of driver style {self.name!r} must not be negative or NaN")


PHYSICAL_FIELDS = tuple(f.name for f in fields(DriverStyle) if f.name not in ("name", "aggressiveness"))
POSITIVE_FIELDS = (
    "desired_speed_factor",
    "time_headway_s",
    "max_acceleration_mps2",
    "comfortable_deceleration_mps2",
    "pedal_noise_time_s",
    "lane_wander_time_s",
    "lane_change_duration_s",
    "yellow_slope_per_s",
)
