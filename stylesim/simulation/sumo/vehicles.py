"""A `DriverStyle` and a body as attributes of a SUMO vehicle type; every driver has a type of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stylesim.style import DriverStyle
from stylesim.tracks import AgentKind

LANE_WIDTH_M = 3.5  # chosen, because lane_change_duration_s must become a lateral speed and 3.5 m is a usual lane
NEUTRAL_HEADWAY_S = 1.5
NEUTRAL_GAP_S = 4.5  # agents/styles.yaml: the gap acceptance at which SUMO's own defaults are kept
# sd of the acceleration that EIDM's sigmaerror = 1 gives at tPersDrive = 0.8 s: 0.72 at 0.3 and 0.30 at 0.1
# (60 vehicles, free motorway, measured with SUMO 1.28; docs/logging.md), so about 2.6.
EIDM_NOISE_GAIN_MPS2 = 2.6
EIDM_LARGEST_SIGMA = 0.5  # chosen, because beyond it the noise saturates
JERK_LIMIT_MPS3 = 10.0  # default 3: its clipping at exactly +-3 would be visible in the jerk of restless drivers
EMERGENCY_DECELERATION_MPS2 = 7.5  # hardest of 821 stops (TRID 801675): up to 8 m/s2 is left to the lag of the brakes
TRUCK_HEADWAY = 2.37 / 1.92  # REFERENCE section 5: medians of trucks and cars when following, DLR HT
TRUCK_ACCELERATION = 0.5  # SUMO's defaults: trucks 1.3 m/s2, cars 2.6
TRUCK_TOP_SPEED_MPS = 25.0  # 90 km/h, the limiter of lorries in Europe


@dataclass(frozen=True)
class Entry:
    """Where on its first edge a driver enters, and how fast; without one SUMO chooses."""

    lane: int
    position_m: float  # of the front bumper
    speed_mps: float


@dataclass(frozen=True)
class Driver:
    """One driver and vehicle of an episode; `style` is the commanded one, before what a truck cannot do."""

    driver_id: str
    style: DriverStyle
    kind: AgentKind
    length_m: float
    width_m: float
    depart_s: float
    route: str
    type_suffix: str = ""  # of a driver's second vehicle type (`switching`)
    entry: Entry | None = None

    @property
    def type_id(self) -> str:
        """The id of its vehicle type."""
        return self.driver_id + self.type_suffix


def draw_body(*, truck: bool, rng: np.random.Generator) -> tuple[AgentKind, float, float]:
    """Kind, length and width in m: cars 3.8-5.0 x 1.65-1.95, trucks 6-11 x 2.3-2.55 [ours].

    Trucks are rigid ones: an articulated lorry is no box, as one of 15 m it would sweep over the lanes beside a turn.
    """
    share = rng.random(2)
    if truck:
        return AgentKind.TRUCK, round(6.0 + 5.0 * float(share[0]), 2), round(2.3 + 0.25 * float(share[1]), 2)
    return AgentKind.CAR, round(3.8 + 1.2 * float(share[0]), 2), round(1.65 + 0.3 * float(share[1]), 2)


def type_attributes(driver: Driver, *, pedal_by_sumo: bool = True) -> dict[str, str]:
    """The attributes of the driver's vehicle type.

    EIDM follows (Salles, Kaufmann, Reuss 2020, as built into SUMO): headway, gap, acceleration and braking are
    the style's. With `pedal_by_sumo` its error terms carry the pedal noise, at no cost per step, for SUMO on its own;
    generated episodes leave it to `simulation.foot`, which knows its spectrum and gives null twins another pedal.
    The lane change goes at the lateral speed that takes a lane in `lane_change_duration_s`, and never at more than
    0.3 of the speed ahead.
    """
    style, truck = driver.style, driver.kind == AgentKind.TRUCK
    noise = min(EIDM_LARGEST_SIGMA, style.pedal_noise_mps2 / EIDM_NOISE_GAIN_MPS2) if pedal_by_sumo else 0.0
    acceleration = style.max_acceleration_mps2 * (TRUCK_ACCELERATION if truck else 1.0)
    numbers = {
        "length": driver.length_m,
        "width": driver.width_m,
        "maxSpeed": TRUCK_TOP_SPEED_MPS if truck else 70.0,
        "speedFactor": style.desired_speed_factor,
        "speedDev": 0.0,
        "tau": style.time_headway_s * (TRUCK_HEADWAY if truck else 1.0),
        "minGap": style.min_gap_m,
        "accel": acceleration,
        "decel": style.comfortable_deceleration_mps2,
        "emergencyDecel": EMERGENCY_DECELERATION_MPS2,
        "sigmaerror": noise,
        "sigmagap": min(0.1, noise),
        "sigmaleader": min(0.02, noise),
        "tPersDrive": style.pedal_noise_time_s,
        "jerkmax": JERK_LIMIT_MPS3,
        "maxSpeedLat": LANE_WIDTH_M / style.lane_change_duration_s,
        "lcMaxSpeedLatStanding": 0.0,
        "lcMaxSpeedLatFactor": 0.3,
        "lcSpeedGain": style.lane_change_eagerness,
        "lcCooperative": min(1.0, style.politeness),
        "lcAssertive": NEUTRAL_GAP_S / style.gap_acceptance_s * style.time_headway_s / NEUTRAL_HEADWAY_S,
        "jmTimegapMinor": style.gap_acceptance_s / NEUTRAL_GAP_S,
    }
    words = {"vClass": "truck" if truck else "passenger", "carFollowModel": "EIDM", "laneChangeModel": "LC2013"}
    return words | {name: f"{value:.4f}" for name, value in numbers.items()}
