"""From what SUMO said (front bumpers) to what is logged: box centres, velocities, headings, with wander.

SUMO moves points along lane centre lines and slides them over at a constant lateral speed in a lane change. Here

1. the lateral part of lane changes is smoothed as a driver would steer it (`wander.smoothed_slide`): it lags SUMO by
   0.5 s, up to 0.6 m, and reads nothing later;
2. the driver's wander is added to the path of the front bumper, square to the line from its rear to its front;
3. the body follows that path: its middle and rear are half a length and a length further back on it; the centre is
   the mean of the path under the body (five points), which also rounds the corners of SUMO's polylines; the
   heading points from the rear to the front;
4. the velocity is the step of the centre divided by dt (SUMO's Euler speed is the step that was made, too).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32

from stylesim.randomness import stream
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles
from stylesim.simulation.sumo.paths import Points, Rows, Segments, directions, points_behind
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.simulation.wander import ROOM_BEYOND_LANE_M, lateral_wander, smoothed_slide

RENAMED_M = 1.0  # the lateral position jumps by a lane's width where SUMO renames the lane; a step moves 0.15 m at most


@dataclass(frozen=True, eq=False)
class Bodies:
    """Rows ordered by driver and step, in SUMO's frame."""

    driver: Int32[np.ndarray, " row"]
    step: Int32[np.ndarray, " row"]
    front_m: Points  # as SUMO had it
    speed_mps: Rows  # of that front bumper
    position_m: Points
    velocity_mps: Points
    heading_rad: Rows
    segments: Segments


def bodies_of(log: RawLog, files: EpisodeFiles) -> Bodies:
    """Every row of the log as a body."""
    order = np.argsort(log.driver, kind="stable")
    driver, step = log.driver[order], log.step[order]
    front, lateral = log.front_m[order], log.lateral_m[order]
    segments = Segments.of(driver, step)
    unit = directions(front, segments, log.first_heading_rad[driver])
    moved = segments.change(front)
    speed = np.hypot(moved[:, 0], moved[:, 1]) / DT_S
    after = np.minimum(segments.starts + 1, len(speed) - 1)
    speed[segments.starts] = np.where(segments.first[after] == segments.starts, speed[after], 0.0)
    length = np.array([files.drivers[name].length_m for name in log.driver_ids])[driver]
    (tail,) = points_behind(front, unit, segments, (length,))
    nose = front + _offset(log, files, driver, step, speed, lateral)[:, None] * _left_of(front - tail)
    nose_unit = directions(nose, segments, log.first_heading_rad[driver])
    quarter, half, late, rear = points_behind(
        nose, nose_unit, segments, (length / 4, length / 2, 0.75 * length, length)
    )
    centre = ((nose + rear) / 2 + quarter + half + late) / 4
    axis = nose - rear
    return Bodies(
        driver=driver,
        step=step,
        front_m=front,
        speed_mps=speed,
        position_m=centre,
        velocity_mps=segments.change(centre) / DT_S,
        heading_rad=np.arctan2(axis[:, 1], axis[:, 0]),
        segments=segments,
    )


def _left_of(axis_m: Points) -> Points:
    """Unit vectors to the left."""
    length = np.maximum(np.hypot(axis_m[:, 0], axis_m[:, 1]), 1e-9)
    return np.stack([-axis_m[:, 1] / length, axis_m[:, 0] / length], axis=1)


def _offset(
    log: RawLog,
    files: EpisodeFiles,
    driver: Int32[np.ndarray, " row"],
    step: Int32[np.ndarray, " row"],
    speed_mps: Rows,
    lateral_m: Rows,
) -> Rows:
    """Wander, and what lane changes lag, of every row; a driver's clock starts with its first row."""
    drivers = [files.drivers[name] for name in log.driver_ids]
    begin = np.full(len(drivers), np.iinfo(np.int32).max, np.int32)
    np.minimum.at(begin, driver, step)
    frame = step - begin[driver]
    speed = np.zeros((len(drivers), int(frame.max(initial=0)) + 1))
    speed[driver, frame] = speed_mps
    narrowest = min(lane.width_m for lane in files.network.road.lanes)
    width = np.array([item.width_m for item in drivers])
    wander = lateral_wander(
        [item.style for item in drivers],
        speed,
        limit_m=np.maximum((narrowest - width) / 2 + ROOM_BEYOND_LANE_M, 0.0),
        dt_s=DT_S,
        streams=[stream(files.seed, files.episode, item.driver_id, "wander") for item in drivers],
    )
    return wander[driver, frame] + _lane_change_lag(driver, frame, speed, lateral_m)


def _lane_change_lag(
    driver: Int32[np.ndarray, " row"],
    frame: Int32[np.ndarray, " row"],
    speed_mps: Float64[np.ndarray, "driver time"],
    lateral_m: Rows,
) -> Rows:
    """Smoothed minus SUMO's lateral position; 0 for who changes no lane."""
    slide = np.zeros_like(lateral_m)
    slide[1:] = np.diff(lateral_m)
    slide[(frame == 0) | (np.abs(slide) > RENAMED_M)] = 0.0
    changing = np.zeros(len(speed_mps), bool)
    changing[driver[slide != 0.0]] = True
    rows = np.flatnonzero(changing[driver])
    if not len(rows):
        return slide
    number = np.cumsum(changing) - 1
    who, when = number[driver[rows]], frame[rows]
    steps = np.zeros((int(changing.sum()), speed_mps.shape[1]))
    steps[who, when] = slide[rows]
    path = np.cumsum(steps, axis=1)
    lag = np.zeros_like(lateral_m)
    lag[rows] = (smoothed_slide(path, speed_mps[changing], dt_s=DT_S) - path)[who, when]
    return lag
