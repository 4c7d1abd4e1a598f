"""The hot loops over lanes, compiled by numba at their first call and cached."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
@no_type_check
def match_lanes(
    position, heading, wanted, block, segment, turn, segment_lane, reach, cell_start, cell_segment, origin, shape,
    cell_m, least_cosine, metres_per_rad, keep_within_m, lane, along, offset,
):  # fmt: skip
    """Find the lanes that each wanted vehicle is on, best first.

    position [agent time 2], heading, wanted [agent time], block [time] (between blocks nothing is remembered),
    segment and turn as in `RoadIndex`;
    lane, along, offset [agent time place] are written, lane -1 where there is none.
    """
    agents, frames, places = lane.shape
    score = np.empty(places)
    for agent in range(agents):
        previous = -1
        for frame in range(frames):
            if frame > 0 and block[frame] != block[frame - 1]:
                previous = -1
            if not wanted[agent, frame]:
                previous = -1
                continue
            x, y = np.float64(position[agent, frame, 0]), np.float64(position[agent, frame, 1])
            column, row = int(np.floor((x - origin[0]) / cell_m)), int(np.floor((y - origin[1]) / cell_m))
            if column < 0 or row < 0 or column >= shape[0] or row >= shape[1]:
                previous = -1
                continue
            hx, hy = np.cos(np.float64(heading[agent, frame])), np.sin(np.float64(heading[agent, frame]))
            cell = column * shape[1] + row
            score[:] = np.inf
            entry, last = cell_start[cell], cell_start[cell + 1]
            while entry < last:
                current = segment_lane[cell_segment[entry]]
                nearest = np.inf
                foot = side = place = 0.0
                best = -1
                while entry < last and segment_lane[cell_segment[entry]] == current:
                    k = cell_segment[entry]
                    entry += 1
                    px, py = x - segment[k, 0], y - segment[k, 1]
                    t = min(max(px * segment[k, 2] + py * segment[k, 3], 0.0), segment[k, 4])
                    gx, gy = px - t * segment[k, 2], py - t * segment[k, 3]
                    squared = gx * gx + gy * gy
                    if squared < nearest:
                        nearest, best, place = squared, k, t
                distance = np.sqrt(nearest)
                if distance > reach[current]:
                    continue
                blend = place / segment[best, 4]
                ux = turn[best, 0] * (1.0 - blend) + turn[best, 2] * blend
                uy = turn[best, 1] * (1.0 - blend) + turn[best, 3] * blend
                norm = np.sqrt(ux * ux + uy * uy)
                cosine = (ux * hx + uy * hy) / max(norm, 1e-9)
                if cosine < least_cosine:
                    continue
                foot = segment[best, 5] + place
                side = segment[best, 2] * (y - segment[best, 1]) - segment[best, 3] * (x - segment[best, 0])
                side = distance if side >= 0.0 else -distance
                value = distance + metres_per_rad * np.arccos(min(1.0, cosine))
                for i in range(places):
                    if value < score[i]:
                        for j in range(places - 1, i, -1):
                            score[j], lane[agent, frame, j] = score[j - 1], lane[agent, frame, j - 1]
                            along[agent, frame, j] = along[agent, frame, j - 1]
                            offset[agent, frame, j] = offset[agent, frame, j - 1]
                        score[i], lane[agent, frame, i] = value, current
                        along[agent, frame, i], offset[agent, frame, i] = foot, side
                        break
            for i in range(1, places):  # stay on the lane of the frame before where another is hardly better
                if score[i] - score[0] > keep_within_m:
                    break
                if lane[agent, frame, i] == previous:
                    lane[agent, frame, i], lane[agent, frame, 0] = lane[agent, frame, 0], lane[agent, frame, i]
                    for array in (along, offset):
                        array[agent, frame, i], array[agent, frame, 0] = array[agent, frame, 0], array[agent, frame, i]
                    break
            previous = lane[agent, frame, 0]


@njit(cache=True, nogil=True)
@no_type_check
def lane_leaders(
    lane, along, offset, reach, tolerance, length, ahead_start, ahead_lane, ahead_m, size, is_ego, is_other, range_m,
    leader, gap,
):  # fmt: skip
    """The next vehicle on each ego's lane, or on the nearest way through its successors.

    A vehicle counts on every lane within whose edges its centre is; leader [agent time] is -1 where none is in range.
    """
    agents, frames, places = lane.shape
    on_lane = np.empty(agents * places, np.int64)
    who = np.empty(agents * places, np.int64)
    where, key = np.empty(agents * places), np.empty(agents * places)
    longest = 1.0 + (length.max() if len(length) else 0.0)
    lanes = len(length)
    begin = np.zeros(lanes + 1, np.int64)
    for frame in range(frames):
        count = 0
        for agent in range(agents):
            if not is_other[agent, frame]:
                continue
            for k in range(places):
                here = lane[agent, frame, k]
                if here >= 0 and (k == 0 or abs(offset[agent, frame, k]) <= reach[here] - tolerance):
                    on_lane[count], who[count], where[count] = here, agent, along[agent, frame, k]
                    key[count] = here * longest + where[count]  # by lane, then by the way along it
                    count += 1
        begin[:] = 0
        for i in range(count):
            begin[on_lane[i] + 1] += 1
        for i in range(lanes):
            begin[i + 1] += begin[i]
        order = np.argsort(key[:count])
        for ego in range(agents):
            home = lane[ego, frame, 0]
            if home < 0 or not is_ego[ego, frame]:
                continue
            own = along[ego, frame, 0]
            best, found = np.inf, -1
            for i in range(begin[home], begin[home + 1]):
                entry = order[i]
                if where[entry] > own and who[entry] != ego:
                    best, found = where[entry] - own, who[entry]
                    break
            rest = length[home] - own
            for k in range(ahead_start[home], ahead_start[home + 1]):
                if rest + ahead_m[k] >= min(best, range_m + 0.5 * (size[ego, 0] + 50.0)):
                    break
                for i in range(begin[ahead_lane[k]], begin[ahead_lane[k] + 1]):
                    entry = order[i]
                    if who[entry] == ego:
                        continue
                    if rest + ahead_m[k] + where[entry] < best:
                        best, found = rest + ahead_m[k] + where[entry], who[entry]
                    break
            if found >= 0:
                distance = max(0.0, best - 0.5 * (size[ego, 0] + size[found, 0]))
                if distance <= range_m:
                    leader[ego, frame] = found
                    gap[ego, frame] = distance


@njit(cache=True, nogil=True)
@no_type_check
def lane_pieces(lane, offset, run, bridge, jump, piece, changes):
    """Number the stretches on one lane (or its successors), and mark the first frame after each lane change.

    lane, offset, run, piece, changes [agent time]. A change is a jump of the offset with the lane, after at most
    `bridge` frames without a lane; a stretch also ends where the lane or the run is interrupted.
    """
    agents, frames = lane.shape
    for agent in range(agents):
        last, number = -1, 0
        for frame in range(frames):
            if lane[agent, frame] < 0 or run[agent, frame] < 0:
                continue
            together = last >= 0 and run[agent, last] == run[agent, frame]
            if together and frame - last <= bridge and lane[agent, last] != lane[agent, frame]:
                changes[agent, frame] = abs(offset[agent, frame] - offset[agent, last]) > jump
            if changes[agent, frame] or not together or frame - last > 1:
                number += 1
            piece[agent, frame] = number
            last = frame


@njit(cache=True, nogil=True)
@no_type_check
def near_event(event, block, within, near):
    """Mark the frames of its block within that many of an event, before and after; event, near [agent time]."""
    agents, frames = event.shape
    for agent in range(agents):
        for frame in range(frames):
            if event[agent, frame]:
                for other in range(max(0, frame - within), min(frames, frame + within + 1)):
                    if block[other] == block[frame]:
                        near[agent, other] = True
