"""`label`: the styles of every track and of every history of a corpus, written beside it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from stylesim.labelers.base import Labeler, Progress
from stylesim.labelers.history import scene_history_labels
from stylesim.labels import StyleLabels
from stylesim.windows import WindowSpec, anchor_frames, target_agents

if TYPE_CHECKING:
    from stylesim.corpus import Corpus


def label(
    corpus: Corpus, labeler: Labeler, *, spec: WindowSpec | None = None, progress: Progress | None = None
) -> StyleLabels:
    """Label every motor vehicle's track, and every history that `spec` asks a forecaster about; returns the former.

    Both are written with `Corpus.write_labels`. One scene is in memory at a time. A history label is computed from
    `scene.history(t0, ...)` alone. InputError if the labeller is not fitted, or not for histories of that length.
    """
    spec = spec or WindowSpec()
    total = 2 * len(corpus)
    corpus.write_labels(_tracks(corpus, labeler, progress, total))
    corpus.write_labels(_histories(corpus, labeler, spec, progress, total))
    return corpus.labels(labeler.method, "track")


def _tracks(corpus: Corpus, labeler: Labeler, progress: Progress | None, total: int) -> Iterator[StyleLabels]:
    for done, scene in enumerate(corpus, start=1):
        yield labeler.label_windows(scene)
        if progress is not None:
            progress(done, total)


def _histories(
    corpus: Corpus, labeler: Labeler, spec: WindowSpec, progress: Progress | None, total: int
) -> Iterator[StyleLabels]:
    for done, scene in enumerate(corpus, start=1):
        anchors = [(t0, target_agents(scene, t0, spec)) for t0 in anchor_frames(scene, spec)]
        asked = [(t0, agents) for t0, agents in anchors if len(agents)]
        if not asked and done == 1:  # a file without rows says that there was nothing to ask; no file, that it failed
            asked = [(scene.tracks.n_frames - 1, np.zeros(0, np.int32))]
        for t0, agents in asked:
            yield scene_history_labels(labeler, scene, t0, spec, agents)
        if progress is not None:
            progress(len(corpus) + done, total)
