"""How hard a driver brakes for whom it follows: the improved IDM, cool where a gap is small but nothing at stake."""

from __future__ import annotations

import math

COOLNESS = 0.99  # Kesting, Treiber, Helbing 2010 [recalled]
LEAST_FREE_MPS2 = 1e-3  # below it the driver goes as fast as it wishes
LEAST_GAP_M = 0.1  # nearer than that counts as that near


def free_road(speed_mps: float, wish_mps: float, *, bold: float, ease: float) -> float:
    """Acceleration on a free road, m/s2: a (1 - (v / v0)^4), not harder than comfortable braking (Treiber 2000)."""
    ratio = speed_mps / wish_mps
    return max(bold * (1.0 - ratio * ratio * ratio * ratio), -ease)


def behind_leader(
    free: float,
    speed_mps: float,
    leader_speed_mps: float,
    leader_mps2: float,
    gap_m: float,
    *,
    headway_s: float,
    standing_m: float,
    bold: float,
    ease: float,
) -> float:
    """Improved IDM acceleration behind a leader (Treiber and Kesting 2013 [recalled]), tempered by `cool`, m/s2.

    Unlike the IDM of 2000 it keeps the wished speed up to the wished gap: with it a driver who wants a far gap would
    crawl behind somebody 200 m ahead. `free` is the acceleration without the leader, the gap is bumper to bumper, the
    leader's speed and acceleration are along the driver's own direction.
    """
    gap_m = max(gap_m, LEAST_GAP_M)
    closing = speed_mps - leader_speed_mps
    wanted = standing_m + speed_mps * headway_s + speed_mps * closing / (2.0 * math.sqrt(bold * ease))
    share = max(wanted, standing_m) / gap_m
    if share >= 1.0:
        idm = min(free, 0.0) + bold * (1.0 - share * share)
    elif free > LEAST_FREE_MPS2:
        idm = free * (1.0 - share ** (2.0 * bold / free))
    else:
        idm = free
    return min(free, cool(idm, speed_mps, leader_speed_mps, leader_mps2, gap_m, bold=bold, ease=ease))


def cool(
    idm_mps2: float,
    speed_mps: float,
    leader_speed_mps: float,
    leader_mps2: float,
    gap_m: float,
    *,
    bold: float,
    ease: float,
) -> float:
    """The IDM's acceleration, tempered by the constant-acceleration heuristic.

    Kesting, Treiber, Helbing 2010 [recalled]. The IDM takes a gap that is smaller than wished for an emergency,
    also where a faster car cut in and nothing is at stake; the heuristic asks what is needed if the leader keeps
    its acceleration. `bold` and `ease` are the driver's greatest acceleration and comfortable deceleration, m/s2.
    """
    leader_speed = max(leader_speed_mps, 0.0)
    leader_mps2 = min(leader_mps2, bold)
    closing = speed_mps - leader_speed
    if leader_mps2 < 0 and leader_speed * closing <= -2 * gap_m * leader_mps2:
        heuristic = speed_mps**2 * leader_mps2 / (leader_speed**2 - 2 * gap_m * leader_mps2)
    else:
        heuristic = leader_mps2 - max(closing, 0.0) ** 2 / (2 * gap_m)
    if idm_mps2 >= heuristic:
        return idm_mps2
    tempered = heuristic + ease * math.tanh((idm_mps2 - heuristic) / ease)
    return (1 - COOLNESS) * idm_mps2 + COOLNESS * tempered
