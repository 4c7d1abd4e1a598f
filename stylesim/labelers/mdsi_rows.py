"""The rows that MDSI answers: which driver, which frames, and whether he was there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int, Int32

from stylesim.errors import InputError
from stylesim.scene import Scene

Rows = tuple[Int[np.ndarray, " row"], Int32[np.ndarray, " row"], Int32[np.ndarray, " row"], Bool[np.ndarray, " row"]]


def track_rows(scene: Scene, agents: Int[np.ndarray, " driver"] | None) -> Rows:
    """Agent, first frame, frame after the last, and whether he was seen at all."""
    tracks = scene.tracks
    if agents is None:
        agents = np.flatnonzero(tracks.is_motor & tracks.valid.any(axis=1))
    valid = tracks.valid[agents]
    first, stop = valid.argmax(axis=1), valid.shape[1] - valid[:, ::-1].argmax(axis=1)
    return agents, first.astype(np.int32), stop.astype(np.int32), np.asarray(valid.any(axis=1))


def history_rows(
    scene: Scene, starts: Sequence[int], length_steps: int, agents: Int[np.ndarray, " driver"] | None
) -> Rows:
    """One row per start and driver; known are those seen at t0. InputError for a t0 outside of the scene."""
    parts = []
    for start in starts:
        t0 = start + length_steps - 1
        if not 0 <= t0 < scene.tracks.n_frames:
            raise InputError(f"scene {scene.scene_id!r} has no frame {t0} for a t0")
        at_t0 = scene.tracks.history(t0, 1).valid[:, -1]
        chosen = np.flatnonzero(at_t0 & scene.tracks.is_motor) if agents is None else agents
        n = len(chosen)
        parts.append(
            (chosen, np.full(n, max(start, 0), np.int32), np.full(n, t0 + 1, np.int32), np.asarray(at_t0[chosen]))
        )
    agent, first, stop, known = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return agent, first, stop, known
