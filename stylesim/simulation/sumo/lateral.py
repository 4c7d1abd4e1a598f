"""What moves a vehicle sideways: SUMO's lane changes, taken apart from the way ahead, and the driver's wander."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int32

from stylesim.simulation.sumo.clocks import Clocks, switch_of
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.paths import Points, Rows, Segments
from stylesim.simulation.sumo.recorder import RawLog
from stylesim.simulation.wander import ROOM_BEYOND_LANE_M, lateral_wander, smoothed_slide

RENAMED_M = 1.0  # the lateral position jumps by a lane's width where SUMO renames the lane; a step moves 0.15 m at most


def slides(lateral_m: Rows, segments: Segments) -> Rows:
    """The sideways step of each row, left positive; where SUMO renames the lane the step before goes on."""
    slide = segments.change(lateral_m)
    renamed = np.flatnonzero(np.abs(slide) > RENAMED_M)
    before = np.maximum(renamed - 1, 0)
    slide[renamed] = np.where(segments.first[before] == segments.first[renamed], slide[before], 0.0)
    slide[np.abs(slide) > RENAMED_M] = 0.0
    return slide


def without_slide(step_m: Points, slide_m: Rows) -> Points:
    """The part of each step that goes along the lane, from the whole step and its known part square to the lane."""
    sliding = np.flatnonzero(slide_m)
    x, y, side = step_m[sliding, 0], step_m[sliding, 1], slide_m[sliding]
    squared = np.maximum(x**2 + y**2, 1e-18)
    ahead = np.sqrt(np.maximum(squared - side**2, 0.0))
    result = step_m.copy()
    # turned clockwise by atan2(side, ahead) and shortened to `ahead`
    result[sliding, 0] = (x * ahead + y * side) * ahead / squared
    result[sliding, 1] = (y * ahead - x * side) * ahead / squared
    return result


def offsets(log: RawLog, files: Episode, clocks: Clocks, speed_mps: Rows, slide_m: Rows) -> Rows:
    """Wander, and what lane changes lag, of every row."""
    drivers = [files.drivers[name] for name in log.driver_ids]
    speed = clocks.table(speed_mps)
    narrowest = min(lane.width_m for lane in files.network.road.lanes)
    width = np.array([item.width_m for item in drivers])
    wander = lateral_wander(
        [item.style for item in drivers],
        speed,
        limit_m=np.maximum((narrowest - width) / 2 + ROOM_BEYOND_LANE_M, 0.0),
        dt_s=DT_S,
        streams=[files.stream(item.driver_id, "wander") for item in drivers],
        switch=switch_of(log, files, clocks, "wander"),
    )
    return clocks.rows(wander) + _lane_change_lag(clocks.driver, clocks.frame, speed, slide_m)


def _lane_change_lag(
    driver: Int32[np.ndarray, " row"],
    frame: Int32[np.ndarray, " row"],
    speed_mps: Float64[np.ndarray, "driver time"],
    slide_m: Rows,
) -> Rows:
    """Smoothed minus SUMO's lateral position; 0 for who changes no lane."""
    lag = np.zeros_like(slide_m)
    changing = np.zeros(len(speed_mps), bool)
    changing[driver[slide_m != 0.0]] = True
    rows = np.flatnonzero(changing[driver])
    if not len(rows):
        return lag
    who, when = (np.cumsum(changing) - 1)[driver[rows]], frame[rows]
    steps = np.zeros((int(changing.sum()), speed_mps.shape[1]))
    steps[who, when] = slide_m[rows]
    path = np.cumsum(steps, axis=1)
    lag[rows] = (smoothed_slide(path, speed_mps[changing], dt_s=DT_S) - path)[who, when]
    return lag
