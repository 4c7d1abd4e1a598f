"""Which frames belong to which window of which agent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int32

# A window that misses more of its frames than a tenth is short. Chosen: a second of an 11 s window.
FULL_SHARE = 0.9


@dataclass(frozen=True, eq=False)
class Cut:
    """Windows of every agent.

    `window` numbers the window that a frame counts in (-1: none); `run` the stretch that it is smoothed in (-1 where
    invalid): the window itself and what is left over beside it, never another window. `block` numbers the stretch of
    time that a frame is from: frames of different blocks know nothing of each other.
    """

    window: Int32[np.ndarray, "agent time"]
    run: Int32[np.ndarray, "agent time"]
    block: Int32[np.ndarray, " time"]
    n_windows: int
    length_steps: int


def whole(valid: Bool[np.ndarray, "agent time"]) -> Cut:
    """One window that holds every frame."""
    return blocks(valid, valid.shape[1])


def blocks(valid: Bool[np.ndarray, "agent time"], length_steps: int) -> Cut:
    """Windows of that length side by side, the same for every agent, each a block of its own."""
    block = (np.arange(valid.shape[1]) // length_steps).astype(np.int32)
    window = np.where(valid, block, np.int32(-1))
    return Cut(
        window=window, run=window, block=block, n_windows=valid.shape[1] // length_steps, length_steps=length_steps
    )


def tiles(valid: Bool[np.ndarray, "agent time"], length_steps: int) -> Cut:
    """As many windows of that length as fit between an agent's first and last frame, side by side, centred.

    An agent that is shorter than one window has one window that is shorter.
    """
    frames = valid.shape[1]
    seen = valid.any(axis=1)
    first = np.where(seen, valid.argmax(axis=1), 0)
    last = np.where(seen, frames - 1 - valid[:, ::-1].argmax(axis=1), 0)
    span = last - first + 1
    count = span // length_steps
    begin = first + np.where(count > 0, (span - count * length_steps) // 2, 0)
    number = (np.arange(frames)[None, :] - begin[:, None]) // length_steps
    most = np.maximum(count, 1)[:, None] - 1
    inside = (number >= 0) & (number <= most)
    return Cut(
        window=np.where(valid & inside, number, -1).astype(np.int32),
        run=np.where(valid, np.clip(number, 0, most), -1).astype(np.int32),
        block=np.zeros(frames, np.int32),
        n_windows=int(max(1, count.max(initial=0))),
        length_steps=length_steps,
    )
