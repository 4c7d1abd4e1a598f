"""Reward and safety cost of one decision period, term by term."""

from __future__ import annotations

import numpy as np

from stylesim.envs.config import EnvConfig
from stylesim.envs.world import EgoState, Snapshot

HARSH_ACCELERATION_MPS2 = 3.0  # where discomfort is 1: the usual bound of comfortable braking


def reward_terms(ego: EgoState, config: EnvConfig) -> dict[str, float]:
    """The weighted terms; the reward is their sum.

    progress: distance over the period relative to the speed limit, at most 1, times weight and period. An ego that
    leaves the network is paid the rest of the time at the full rate, so that arriving early is never a loss.
    comfort: −(rms acceleration / 3 m/s²)², times weight and period. collision, red: −weight, once each.
    """
    weights, period_s = config.reward, config.period_s
    full_m = max(ego.speed_limit_mps, 1.0) * period_s
    rest_s = max(config.duration_s - ego.time_s, 0.0) if ego.arrived else 0.0
    return {
        "progress": weights.progress * (period_s * min(ego.travelled_m / full_m, 1.0) + rest_s),
        "comfort": 0.0 - weights.comfort * period_s * (ego.rms_acceleration_mps2 / HARSH_ACCELERATION_MPS2) ** 2,
        "collision": 0.0 - weights.collision * float(ego.collided > 0),
        "red": 0.0 - weights.red * float(ego.reds_run),
    }


def cost_terms(snapshot: Snapshot, config: EnvConfig) -> dict[str, float]:
    """The weighted terms of the safety cost: collision, red light run, closeness (a short time to collision)."""
    weights = config.cost
    closeness = max(0.0, 1.0 - time_to_collision_s(snapshot) / weights.critical_ttc_s)
    return {
        "collision": weights.collision * float(snapshot.ego.collided > 0),
        "red": weights.red * float(snapshot.ego.reds_run),
        "closeness": weights.closeness * config.period_s * closeness,
    }


def time_to_collision_s(snapshot: Snapshot) -> float:
    """Least time until the ego's box meets one ahead in its straight corridor, velocities kept; inf if none."""
    ego, others = snapshot.pose[0], snapshot.pose[1:]
    c, s = np.cos(ego[4]), np.sin(ego[4])
    away = others[:, :2] - ego[:2]
    ahead, aside = away @ np.array([c, s]), np.abs(away @ np.array([-s, c]))
    gap = ahead - (others[:, 5] + ego[5]) / 2
    closing = (ego[2:4] - others[:, 2:4]) @ np.array([c, s])
    meets = (ahead > 0) & (aside < (others[:, 6] + ego[6]) / 2) & (closing > 1e-6)
    if not meets.any():
        return float("inf")
    return float((np.maximum(gap[meets], 0.0) / closing[meets]).min())
