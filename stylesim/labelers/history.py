"""Labels from what is known at t0: what may condition a forecast."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from stylesim.labelers.base import Labeler
from stylesim.labels import StyleLabels
from stylesim.scene import Scene


def history_labels(
    labeler: Labeler,
    history: Scene,
    agents: Int[np.ndarray, " driver"] | int,
    *,
    history_s: float | None = None,
) -> StyleLabels:
    """Labels of these agents of a scene that `Scene.history` made; its last frame is t0.

    The same bits as `labelling.label` stored for that scene, t0 and agent, if the scene still has all of its agents
    (they are one another's neighbours). Frames are numbered from the start of `history`. `history_s` is the nominal
    length, which chooses the scaler; None: the shortest fitted length that holds the scene, else the longest.
    """
    frames, dt_s = history.tracks.n_frames, history.tracks.dt_s
    if history_s is None:
        lengths = sorted(labeler.history_s)
        history_s = next((s for s in lengths if round(s / dt_s) >= frames), lengths[-1])
    steps = max(1, round(history_s / dt_s))
    index = np.atleast_1d(np.asarray(agents, np.int32))
    return labeler.label_windows(history, [frames - steps], steps, span="history", agents=index)
