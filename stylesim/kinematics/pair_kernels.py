"""The loops over pairs of vehicles, compiled by numba at their first call and cached.

Each loop runs over frames or agents in a fixed order on one core, so the same input gives the same bits.
"""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
@no_type_check
def left_its_place(position, run, more_than, moved):
    """Mark every frame of a run in which the agent came further than `more_than` from where the run began."""
    agents, frames = run.shape
    for agent in range(agents):
        start = 0
        while start < frames:
            stop, gone = start + 1, False
            if run[agent, start] >= 0:
                while stop < frames and (run[agent, stop] == run[agent, start] or run[agent, stop] < 0):
                    if run[agent, stop] >= 0 and not gone:
                        dx = np.float64(position[agent, stop, 0]) - position[agent, start, 0]
                        dy = np.float64(position[agent, stop, 1]) - position[agent, start, 1]
                        gone = dx * dx + dy * dy > more_than * more_than
                    stop += 1
                for frame in range(start, stop):
                    moved[agent, frame] = gone and run[agent, frame] >= 0
            start = stop


@njit(cache=True, nogil=True)
@no_type_check
def ordered_frame(point, present, frame, index, key):
    """Sort the agents present in a frame along the axis on which they spread more; how many, and which axis."""
    count = 0
    low_x = low_y = np.inf
    high_x = high_y = -np.inf
    for agent in range(present.shape[0]):
        if present[agent, frame]:
            x, y = point[agent, frame, 0], point[agent, frame, 1]
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_y, high_y = min(low_y, y), max(high_y, y)
            index[count] = agent
            count += 1
    axis = 0 if high_x - low_x >= high_y - low_y else 1
    for i in range(count):
        key[i] = point[index[i], frame, axis]
    order = np.argsort(key[:count])
    index[:count] = index[:count][order]
    key[:count] = key[:count][order]
    return count


@njit(cache=True, nogil=True)
@no_type_check
def closing_sums(point, direction, speed, is_ego, is_neighbour, radius, least_cosine, floor, closing, count):
    """Sum max(0, (v - v_n) / distance) over each ego's neighbours, frame by frame; also how many there are.

    point, direction [agent time 2], speed, is_ego, is_neighbour, closing, count [agent time].
    """
    agents, frames = speed.shape
    index = np.empty(agents, np.int64)
    key = np.empty(agents)
    # A frame's vehicles side by side in memory: x, y, direction x, y, speed. The pairs are then read from the cache.
    here = np.empty((agents, 5))
    ego, other = np.empty(agents, np.bool_), np.empty(agents, np.bool_)
    total, number = np.empty(agents), np.empty(agents, np.int32)
    present = is_ego | is_neighbour
    for frame in range(frames):
        n = ordered_frame(point, present, frame, index, key)
        for i in range(n):
            a = index[i]
            here[i, 0], here[i, 1] = point[a, frame, 0], point[a, frame, 1]
            here[i, 2], here[i, 3], here[i, 4] = direction[a, frame, 0], direction[a, frame, 1], speed[a, frame]
            ego[i], other[i] = is_ego[a, frame], is_neighbour[a, frame]
            total[i], number[i] = 0.0, 0
        for i in range(n):
            x, y, ux, uy, v = here[i, 0], here[i, 1], here[i, 2], here[i, 3], here[i, 4]
            for j in range(i + 1, n):
                if key[j] - key[i] > radius:
                    break
                dx, dy = here[j, 0] - x, here[j, 1] - y
                squared = dx * dx + dy * dy
                if squared > radius * radius or ux * here[j, 2] + uy * here[j, 3] < least_cosine:
                    continue
                difference = (v - here[j, 4]) / max(np.sqrt(squared), floor)
                if ego[i] and other[j]:
                    total[i] += max(0.0, difference)
                    number[i] += 1
                if ego[j] and other[i]:
                    total[j] += max(0.0, -difference)
                    number[j] += 1
        for i in range(n):
            closing[index[i], frame], count[index[i], frame] = total[i], number[i]


@njit(cache=True, nogil=True)
@no_type_check
def corridor_scan(point, direction, size, is_ego, is_other, reach, least_cosine, leader, gap):
    """The nearest vehicle whose footprint an ego would meet if it drove straight on; leader -1 where none.

    point, direction [agent time 2], size [agent 2], is_ego, is_other, leader, gap [agent time].
    """
    agents, frames = leader.shape
    index = np.empty(agents, np.int64)
    key = np.empty(agents)
    present = is_ego | is_other
    longest = 0.0
    for agent in range(agents):
        if size[agent, 0] > longest:
            longest = size[agent, 0]
    for frame in range(frames):
        n = ordered_frame(point, present, frame, index, key)
        for i in range(n):
            a = index[i]
            for j in range(i + 1, n):
                if key[j] - key[i] > reach + longest:
                    break
                b = index[j]
                dx = point[b, frame, 0] - point[a, frame, 0]
                dy = point[b, frame, 1] - point[a, frame, 1]
                cosine = (
                    direction[a, frame, 0] * direction[b, frame, 0] + direction[a, frame, 1] * direction[b, frame, 1]
                )
                if cosine < least_cosine:
                    continue
                half_width = 0.5 * (size[a, 1] + size[b, 1])
                half_length = 0.5 * (size[a, 0] + size[b, 0])
                for side in range(2):
                    ego, other, sign = (a, b, 1.0) if side == 0 else (b, a, -1.0)
                    if not (is_ego[ego, frame] and is_other[other, frame]):
                        continue
                    hx, hy = direction[ego, frame, 0], direction[ego, frame, 1]
                    along = sign * (dx * hx + dy * hy)
                    across = sign * (dy * hx - dx * hy)
                    if along <= 0.0 or abs(across) >= half_width:
                        continue
                    distance = max(0.0, along - half_length)
                    if distance <= reach and (leader[ego, frame] < 0 or distance < gap[ego, frame]):
                        leader[ego, frame] = other
                        gap[ego, frame] = distance
