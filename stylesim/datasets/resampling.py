"""From the source's clock to the common one of 0.1 s.

A rate that is a whole multiple of 10 Hz is decimated: every k-th frame is taken as it is, nothing is
interpolated or averaged, so positions, velocities and their noise stay the source's. Other rates are
interpolated (see `merging.clock`, which works on scenes).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stylesim.datasets.recording import NEVER, Recording
from stylesim.errors import InputError

COMMON_DT_S = 0.1  # the clock of every corpus that is merged or trained on (docs/architecture.md)


def decimated(recording: Recording, dt_s: float = COMMON_DT_S) -> Recording:
    """Every k-th frame of a recording, counted from its frame 0; the others are counted as dropped.

    A row stays invisible until the first kept frame at or after the detection that it depends on. InputError
    where the source's step does not divide `dt_s`.
    """
    every = round(dt_s / recording.dt_s)
    if every < 1 or abs(every * recording.dt_s - dt_s) > 1e-6:
        raise InputError(
            f"{recording.recording_id}: a step of {recording.dt_s} s does not divide {dt_s} s; it cannot be decimated"
        )
    keep = recording.frame % every == 0
    ahead = recording.lookahead[keep]
    return replace(
        recording,
        agent=recording.agent[keep],
        frame=recording.frame[keep] // every,
        position_m=recording.position_m[keep],
        velocity_mps=recording.velocity_mps[keep],
        heading_rad=recording.heading_rad[keep],
        lookahead=np.where(ahead >= NEVER, NEVER, -(-ahead // every)),
        dt_s=dt_s,
        dropped={**recording.dropped, "other_rate": int((~keep).sum())},
    )
