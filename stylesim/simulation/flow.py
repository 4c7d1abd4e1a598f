"""The wish for speed relative to the traffic around, whatever the simulator.

People choose their speed by the limit and by what others do. Here the wished speed is a mixture: `flow_share` of it is
`flow_speed_factor` times the speed of the slower half of the traffic in sight, the rest is the driver's own wish. A
bold driver is thereby faster than those around, whoever they are, and a calm one slower; bounds keep both near what
the driver would do on a free road [ours].
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

SIGHT_M = 80.0  # chosen: neighbours ahead and behind that a driver compares itself to
SAME_WAY = 0.7  # cosine of the angle between headings of about 45 degrees
QUEUE_SHARE = 0.5  # who is slower than half of one's own wish stands in a queue and sets no example; chosen
ADAPTS_S = 4.0  # time constant with which the wish follows; chosen, because nobody reacts to a passing car at once
FASTEST, SLOWEST = 1.25, 0.8  # of the own wish, which the mixture does not leave; chosen


def flow_speed(
    position_m: Float64[np.ndarray, "vehicle 2"],
    direction: Float64[np.ndarray, "vehicle 2"],
    speed_mps: Float64[np.ndarray, " vehicle"],
    own_wish_mps: Float64[np.ndarray, " vehicle"],
) -> Float64[np.ndarray, " vehicle"]:
    """Mean speed, m/s, of the slower half of those within sight that drive the same way, not in a queue; NaN without.

    The slower half, because they are whom one meets: who wants to be faster passes them, who does not stays behind.
    """
    apart = position_m[:, None] - position_m[None]
    near = (apart**2).sum(axis=2) <= SIGHT_M**2
    near &= direction @ direction.T >= SAME_WAY
    near &= speed_mps[None] >= QUEUE_SHARE * own_wish_mps[:, None]
    np.fill_diagonal(near, False)
    seen = np.sort(np.where(near, speed_mps[None], np.inf), axis=1)
    count = near.sum(axis=1)
    middle = seen[np.arange(len(seen)), np.maximum(count - 1, 0) // 2]
    near &= speed_mps[None] <= middle[:, None]
    count = near.sum(axis=1)
    return np.where(count > 0, (near @ speed_mps) / np.maximum(count, 1), np.nan)


def wished_speed(
    own_wish_mps: Float64[np.ndarray, " vehicle"],
    flow_mps: Float64[np.ndarray, " vehicle"],
    *,
    share: Float64[np.ndarray, " vehicle"],
    factor: Float64[np.ndarray, " vehicle"],
) -> Float64[np.ndarray, " vehicle"]:
    """The mixture, m/s; the own wish where there is no traffic (NaN)."""
    mixed = (1.0 - share) * own_wish_mps + share * factor * flow_mps
    bounded = np.clip(mixed, SLOWEST * own_wish_mps, FASTEST * own_wish_mps)
    return np.where(np.isnan(flow_mps), own_wish_mps, bounded)
