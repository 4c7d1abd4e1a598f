"""The offset from a line of one's own, compiled by numba at its first call and cached."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit

# Metres by which a bound on a distance may be wrong for rounding. Chosen: far above it, far below a segment.
_SLACK_M = 1e-6


@njit(cache=True, nogil=True)
@no_type_check
def nearest_segment(line, arc, x, y, hint):
    """The nearest segment of a polyline, the first of equals, and the squared distance to it.

    line [point 2], arc [point] the way along it. Segments that cannot be nearer than what is found already, since
    the way to them along the line is too long, are passed over; a good `hint` (a segment) makes that most of them.
    """
    nearest, best = segment_distance(line, hint, x, y), hint
    k, count = 0, len(line) - 1
    while k < count:
        squared = segment_distance(line, k, x, y)
        if squared < nearest or (squared == nearest and k < best):
            nearest, best = squared, k
        away = np.sqrt((x - line[k, 0]) ** 2 + (y - line[k, 1]) ** 2)
        free = arc[k] + away - np.sqrt(nearest) - _SLACK_M  # what ends before that is too far away
        k += 1
        while k < count and arc[k + 1] < free:
            k += 1
    return best, nearest


@njit(cache=True, nogil=True)
@no_type_check
def segment_distance(line, k, x, y):
    """Squared distance to segment k, computed in the steps of `geometry.project`."""
    bx, by = line[k + 1, 0] - line[k, 0], line[k + 1, 1] - line[k, 1]
    px, py = x - line[k, 0], y - line[k, 1]
    length = np.hypot(bx, by)
    t = min(max((px * bx + py * by) / max(length * length, 1e-12), 0.0), 1.0)
    gx, gy = px - t * bx, py - t * by
    return gx * gx + gy * gy


@njit(cache=True, nogil=True)
@no_type_check
def offsets_from_lines(position, lane, agent_start, agent_line, line_lane, line_start, point, offset):
    """Measure each agent's offset on its first lane from that lane's line without it, where there is one.

    position [agent time 2], lane, offset [agent time place]; agent_line[agent_start[a] : agent_start[a + 1]] are
    the lines of agent a, line_lane their lanes, point[line_start[l] : line_start[l + 1]] the points of line l.
    """
    longest = 0
    for number in range(len(line_lane)):
        longest = max(longest, line_start[number + 1] - line_start[number])
    line, arc = np.empty((longest, 2)), np.empty(longest)
    for agent in range(lane.shape[0]):
        if agent_start[agent] == agent_start[agent + 1]:
            continue
        current, count, hint = -1, 0, 0
        for frame in range(lane.shape[1]):
            here = lane[agent, frame, 0]
            if here < 0:
                continue
            if here != current:
                current, count, hint = here, 0, 0
                for entry in range(agent_start[agent], agent_start[agent + 1]):
                    number = agent_line[entry]
                    if line_lane[number] != here:
                        continue
                    count = line_start[number + 1] - line_start[number]
                    for i in range(count):
                        line[i, 0], line[i, 1] = point[line_start[number] + i, 0], point[line_start[number] + i, 1]
                        step = 0.0 if i == 0 else np.hypot(line[i, 0] - line[i - 1, 0], line[i, 1] - line[i - 1, 1])
                        arc[i] = step if i == 0 else arc[i - 1] + step
                    break
            if count == 0:
                continue
            x, y = np.float64(position[agent, frame, 0]), np.float64(position[agent, frame, 1])
            hint, squared = nearest_segment(line[:count], arc[:count], x, y, hint)
            side = (line[hint + 1, 0] - line[hint, 0]) * (y - line[hint, 1])
            side -= (line[hint + 1, 1] - line[hint, 1]) * (x - line[hint, 0])
            offset[agent, frame, 0] = np.copysign(np.sqrt(squared), side)
