"""How critical the futures were that had to be forecast: least time to collision and hardest braking needed."""

from __future__ import annotations

import numpy as np
import polars as pl

from stylesim.corpus import Corpus
from stylesim.evaluation.driver_criticality import CRITICAL_DECELERATION_MPS2, CRITICAL_TTC_S
from stylesim.evaluation.following import following
from stylesim.evaluation.slices import Slice, cell
from stylesim.kinematics import required_deceleration_mps2, time_to_collision_s

TTC, BRAKING = "least time to collision", "deceleration needed"
CLOSE_TTC_S = 3.0  # twice the critical one; chosen, because drivers begin to brake at about 3 to 4 s [recalled]
HARD_MPS2 = 2.0  # the comfortable deceleration (REFERENCE section 5)
VALUES = {
    TTC: (
        f"under {CRITICAL_TTC_S:g} s", f"{CRITICAL_TTC_S:g} to {CLOSE_TTC_S:g} s", f"over {CLOSE_TTC_S:g} s, or none",
    ),
    BRAKING: (
        f"over {CRITICAL_DECELERATION_MPS2:g} m/s²", f"{HARD_MPS2:g} to {CRITICAL_DECELERATION_MPS2:g} m/s²",
        f"under {HARD_MPS2:g} m/s², or none",
    ),
}  # fmt: skip


def with_criticality(windows: pl.DataFrame, corpus: Corpus, *, future_s: float) -> pl.DataFrame:
    """`windows` with the columns TTC and BRAKING: each driver behind its leader, in the frames after t0.

    Leaders and speeds are those of `criticality`; the limits of the most critical class are its conflicts, too.
    """
    parts = []
    for (scene_id,), rows in windows.group_by(["scene_id"], maintain_order=True):
        scene = corpus.scene(str(scene_id))
        number = {name: index for index, name in enumerate(scene.tracks.agent_id)}
        found, steps = following(scene), round(future_s / scene.tracks.dt_s)
        ttc = time_to_collision_s(found.gap_m, found.speed_mps, found.leader_speed_mps)
        needed = required_deceleration_mps2(found.gap_m, found.speed_mps, found.leader_speed_mps)
        labels: dict[str, list[str]] = {TTC: [], BRAKING: []}
        for agent_id, t0 in rows.select("agent_id", "t0_frame").iter_rows():
            ahead = (number[agent_id], slice(t0 + 1, t0 + 1 + steps))
            least = float(np.fmin.reduce(ttc[ahead], initial=np.inf))
            most = float(np.fmax.reduce(needed[ahead], initial=0.0))
            labels[TTC].append(VALUES[TTC][int(least >= CRITICAL_TTC_S) + int(least > CLOSE_TTC_S)])
            labels[BRAKING].append(VALUES[BRAKING][int(most <= CRITICAL_DECELERATION_MPS2) + int(most < HARD_MPS2)])
        parts.append(rows.with_columns(pl.Series(name, values) for name, values in labels.items()))
    if not parts:
        return windows.with_columns(pl.lit("").alias(TTC), pl.lit("").alias(BRAKING))
    return pl.concat(parts)


def by_criticality(moving: pl.DataFrame, *, seed: int) -> tuple[Slice, ...]:
    """Errors per class of both, the most critical one first."""
    return tuple(
        cell(moving.filter(pl.col(by) == value), by=by, value=value, seed=seed, within_site=True)
        for by, values in VALUES.items()
        for value in values
    )
