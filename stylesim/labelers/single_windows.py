"""Whole tracks, and the full windows that they are made of, from one pass over a scene."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, Int64

from stylesim.labelers.features import tiled_features
from stylesim.labelers.options import FeatureOptions
from stylesim.labelers.rows import DriverRows, averaged
from stylesim.labels import LabelFlag
from stylesim.scene import Scene
from stylesim.tracks import TrackFlag


def track_and_window_rows(
    scene: Scene, options: FeatureOptions, agents: Int[np.ndarray, " driver"]
) -> tuple[DriverRows, DriverRows, Int64[np.ndarray, " window"]]:
    """One row per driver (the mean of its windows), one row per full window of a driver, and whose each window is.

    Both have span "track" and are judged by the scaler of whole tracks; owners are places in `agents`. A driver
    without a full window has none in the second. `start_frame` and `stop_frame` of a window are those of its driver.
    """
    steps = max(1, round(options.window_s / scene.tracks.dt_s))
    tiles = tiled_features(scene, steps, options)
    tracks = averaged(scene, tiles, agents)
    owner, window = np.nonzero(tiles.full[agents])
    chosen = tiles.at(agents[owner][:, None], window[:, None])
    flags = chosen.flags[:, 0].copy()
    flags[chosen.highway[:, 0] >= 0.5] |= LabelFlag.HIGHWAY  # most of the frames, as for whole tracks
    flags[scene.tracks.flagged(TrackFlag.IMPLAUSIBLE)[agents[owner]]] |= LabelFlag.IMPLAUSIBLE
    windows = DriverRows(
        span="track",
        length_s=tracks.length_s,
        scene_id=(scene.scene_id,) * len(owner),
        agent_id=tuple(tracks.agent_id[i] for i in owner),
        start_frame=tracks.start_frame[owner],
        stop_frame=tracks.stop_frame[owner],
        value=chosen.value[:, 0],
        flags=flags,
    )
    return tracks, windows, owner.astype(np.int64)
