"""`label`: the styles of every track and of every history of a corpus, written beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stylesim.labelers.base import Labeler, Progress
from stylesim.labels import StyleLabels
from stylesim.scene import Scene
from stylesim.windows import WindowSpec, anchor_frames, target_agents

if TYPE_CHECKING:
    from stylesim.corpus import Corpus


def label(
    corpus: Corpus, labeler: Labeler, *, spec: WindowSpec | None = None, progress: Progress | None = None
) -> StyleLabels:
    """Label every motor vehicle's track, and every history that `spec` asks a forecaster about; returns the former.

    Both are written with `Corpus.write_labels`, in one pass with one scene in memory at a time. A history label is
    computed from `scene.history(t0, ...)` alone. InputError if the labeller is not fitted, or not for histories of
    that length.
    """
    corpus.write_labels(_labels(corpus, labeler, spec or WindowSpec(), progress))
    return corpus.labels(labeler.method, "track")


def _labels(corpus: Corpus, labeler: Labeler, spec: WindowSpec, progress: Progress | None) -> Iterator[StyleLabels]:
    for done, scene in enumerate(corpus, start=1):
        yield labeler.label_windows(scene)
        histories = _histories(scene, labeler, spec, always=done == 1)
        if histories is not None:
            yield histories
        if progress is not None:
            progress(done, len(corpus))


def _histories(scene: Scene, labeler: Labeler, spec: WindowSpec, *, always: bool) -> StyleLabels | None:
    """Labels of the drivers that a forecaster is asked about at each t0 of the scene, all in one call; None without.

    `always`: labels without a row then, because a file without rows says that there was nothing to ask, and no file
    that it failed.
    """
    steps = spec.steps(scene.tracks.dt_s)[0]
    asked = {t0: target_agents(scene, t0, spec) for t0 in anchor_frames(scene, spec)}
    anchors = [t0 for t0, agents in asked.items() if len(agents)]
    if not anchors:
        start = scene.tracks.n_frames - steps
        nobody = np.zeros(0, np.int32)
        return labeler.label_windows(scene, [start], steps, span="history", agents=nobody) if always else None
    found = labeler.label_windows(scene, [t0 - steps + 1 for t0 in anchors], steps, span="history")
    wanted = {(t0 + 1, scene.tracks.agent_id[i]) for t0 in anchors for i in asked[t0]}
    rows = zip(found.stop_frame.tolist(), found.agent_id, strict=True)
    return found.rows(np.array([i for i, row in enumerate(rows) if row in wanted], np.int64))
