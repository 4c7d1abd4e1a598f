"""From what SUMO said (front bumpers) to what is logged: box centres, velocities, headings, with wander.

SUMO moves points along lane centre lines and slides them over at a constant lateral speed in a lane change. Here

1. the driver's foot carries out SUMO's speed with bounded jerk and adds its restlessness (`simulation.foot`): the front
   is up to some decimetres ahead of SUMO's or behind it, along the body;
2. the lateral part of lane changes is smoothed as a driver would steer it (`wander.smoothed_slide`): it lags SUMO by
   0.5 s, up to 0.6 m, and reads nothing later;
3. the driver's wander is added to the path of the front bumper, square to its lane under the body;
4. the body follows that path: its middle and rear are half a length and a length further back on it; the centre is
   the mean of the path under the body (five points), which also rounds the corners of SUMO's polylines; the
   heading points from the rear to the front;
5. the velocity is the step of the centre divided by dt (SUMO's Euler speed is the step that was made, too).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int32

from stylesim.simulation.sumo.along import feet
from stylesim.simulation.sumo.clocks import Clocks
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.lateral import offsets, slides, without_slide
from stylesim.simulation.sumo.paths import Points, Rows, Segments, directions, points_behind
from stylesim.simulation.sumo.recorder import RawLog


@dataclass(frozen=True, eq=False)
class Bodies:
    """Rows ordered by driver and step, in SUMO's frame."""

    driver: Int32[np.ndarray, " row"]
    step: Int32[np.ndarray, " row"]
    front_m: Points  # without the wander
    speed_mps: Rows  # along its lane
    position_m: Points
    velocity_mps: Points
    heading_rad: Rows
    segments: Segments


def bodies_of(log: RawLog, files: Episode) -> Bodies:
    """Every row of the log as a body."""
    order = np.argsort(log.driver, kind="stable")
    driver, step, front = log.driver[order], log.step[order], log.front_m[order]
    segments = Segments.of(driver, step)
    rest = log.first_heading_rad[driver]
    slide = slides(log.lateral_m[order], segments)
    ahead = without_slide(segments.change(front), slide)
    clocks = Clocks.of(driver, step, len(log.driver_ids))
    further, speed = feet(log, files, clocks, _speed(ahead, segments))
    length = np.array([files.drivers[name].length_m for name in log.driver_ids])[driver]
    course = segments.total(ahead)  # where the front would be had it only followed its lanes
    (tail,) = points_behind(course, directions(course, segments, rest), segments, (length,))
    axis = _unit(course - tail)
    front = front + further[:, None] * axis
    offset = offsets(log, files, clocks, speed, slide)
    nose = front + offset[:, None] * _left_of(axis)
    places = tuple(share * length for share in (0.25, 0.5, 0.75, 1.0))
    quarter, half, late, rear = points_behind(nose, directions(nose, segments, rest), segments, places)
    centre = ((nose + rear) / 2 + quarter + half + late) / 4
    body = nose - rear
    return Bodies(
        driver=driver,
        step=step,
        front_m=front,
        speed_mps=speed,
        position_m=centre,
        velocity_mps=segments.change(centre) / DT_S,
        heading_rad=np.arctan2(body[:, 1], body[:, 0]),
        segments=segments,
    )


def _speed(ahead_m: Points, segments: Segments) -> Rows:
    """Along the lane; the first row of a segment takes that of the second."""
    speed = np.hypot(ahead_m[:, 0], ahead_m[:, 1]) / DT_S
    after = np.minimum(segments.starts + 1, len(speed) - 1)
    speed[segments.starts] = np.where(segments.first[after] == segments.starts, speed[after], 0.0)
    return speed


def _unit(axis_m: Points) -> Points:
    """Unit vectors that way."""
    return np.asarray(axis_m / np.maximum(np.hypot(axis_m[:, 0], axis_m[:, 1]), 1e-9)[:, None])


def _left_of(axis: Points) -> Points:
    """Unit vectors to the left."""
    return np.stack([-axis[:, 1], axis[:, 0]], axis=1)
