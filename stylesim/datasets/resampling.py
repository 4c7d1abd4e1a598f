"""From the source's clock to the common one of 0.1 s.

A rate that is a whole multiple of 10 Hz is decimated: every k-th frame is taken as it is, nothing is
interpolated or averaged, so positions, velocities and their noise stay the source's. Other rates above 10 Hz (25 Hz)
are carried forward: each frame is the last one of the source, moved on by its own velocity and acceleration for less
than a step of the source. That looks at nothing later, so a frame t0 is known at t0; interpolation would hide half
of all frames. Lower rates keep their step (`merging.clock` interpolates scenes).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from stylesim.datasets.recording import NEVER, Recording
from stylesim.errors import InputError
from stylesim.geometry import wrap_angle

COMMON_DT_S = 0.1  # the clock of every corpus that is merged or trained on (docs/architecture.md)
# Chosen: a clock this close to 10 Hz (SinD: 9.99 Hz) is taken for it, frame by frame: a scene of 20 s is then 20 ms
# too short and accelerations 0.2 % off, less than any other way of resampling would do to them.
SAME_CLOCK = 0.002


def on_clock(recording: Recording, dt_s: float = COMMON_DT_S) -> Recording:
    """The recording on the common clock; one that is slower keeps its own step."""
    ratio = dt_s / recording.dt_s
    if abs(ratio - 1) <= SAME_CLOCK:
        log = recording.signals
        if log is not None:  # the lights go with the frames
            log = replace(log, time_s=log.time_s * ratio)
        return replace(recording, dt_s=dt_s, signals=log)
    if ratio < 1:
        return recording
    if abs(ratio - round(ratio)) * recording.dt_s < 1e-6:
        return decimated(recording, dt_s)
    return carried(recording, dt_s)


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


def carried(recording: Recording, dt_s: float = COMMON_DT_S) -> Recording:
    """The last row at or before each new frame, moved on to it; rows that no new frame needs are counted as dropped.

    Over the time tau since the row, less than a step of the source, position moves by v tau + a tau^2 / 2, velocity
    by a tau and heading at its last rate, with a and the rate from the row and the one before. At 25 Hz tau is at
    most 20 ms, where a jerk of 10 m/s3 makes 0.01 mm. ValueError where the source is slower than `dt_s`.
    """
    step = recording.dt_s
    if step >= dt_s:
        raise ValueError(f"a step of {step} s is not shorter than {dt_s} s")
    time = recording.frame * step
    frame = np.ceil(time / dt_s - 1e-6).astype(np.int64)
    tau = np.maximum(frame * dt_s - time, 0.0)
    keep = tau < step - 1e-6 * dt_s
    rate = _rates(recording)
    shift = tau[keep, None]
    velocity, a = recording.velocity_mps[keep], rate[keep, :2]
    ahead = recording.lookahead[keep]
    wait = np.ceil((ahead * step - tau[keep]) / dt_s - 1e-6).astype(np.int64)
    return replace(
        recording,
        agent=recording.agent[keep],
        frame=frame[keep],
        position_m=recording.position_m[keep] + velocity * shift + a * shift**2 / 2,
        velocity_mps=velocity + a * shift,
        heading_rad=wrap_angle(recording.heading_rad[keep] + rate[keep, 2] * tau[keep]),
        lookahead=np.where(ahead >= NEVER, NEVER, np.maximum(wait, 0)),
        dt_s=dt_s,
        dropped={**recording.dropped, "other_rate": int((~keep).sum())},
    )


def _rates(recording: Recording) -> Float64[np.ndarray, "row 3"]:
    """Backward differences of velocity (two columns) and heading per second; 0 where the row before is not there."""
    change = np.concatenate(
        [np.diff(recording.velocity_mps, axis=0), wrap_angle(np.diff(recording.heading_rad))[:, None]], axis=1
    )
    joined = (np.diff(recording.agent) == 0) & (np.diff(recording.frame) == 1)
    rate = np.zeros((len(recording.frame), 3))
    rate[1:] = np.where(joined[:, None], change / recording.dt_s, 0.0)
    return rate
