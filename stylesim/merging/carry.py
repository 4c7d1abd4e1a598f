"""Labels of the inputs taken over into a merged corpus, where they still hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stylesim.corpus import Corpus
from stylesim.labels import StyleLabels

METHODS = ("tdbm", "kdsc", "mdsi")
SPANS = ("track", "history")


def carried_kinds(corpora: Sequence[Corpus], *, tracks_changed: bool) -> tuple[list[tuple[str, str]], list[str]]:
    """The (method, span) whose labels hold in the merged corpus, and why the others were left behind.

    They hold where every input has them, made by the same labeller (equal provenance), and no track was changed
    by noise or another clock.
    """
    kept, left = [], []
    for method in METHODS:
        for span in SPANS:
            have = [corpus.has_labels(method, span) for corpus in corpora]
            if not any(have):
                continue
            name = f"{method}.{span}"
            if tracks_changed:
                left.append(f"{name}: the tracks were changed by noise or resampling")
            elif not all(have):
                left.append(f"{name}: not every input has them")
            elif not _same_labeller(corpora, method, span):
                left.append(f"{name}: the inputs were labelled by different scalers, fits or options")
            else:
                kept.append((method, span))
    return kept, left


def _same_labeller(corpora: Sequence[Corpus], method: str, span: str) -> bool:
    first = corpora[0].labels(method, span)
    rest = (corpus.labels(method, span) for corpus in corpora[1:])
    return all(
        (other.classes, other.feature_names, dict(other.provenance))
        == (first.classes, first.feature_names, dict(first.provenance))
        for other in rest
    )


def carried_labels(
    corpora: Sequence[Corpus],
    method: str,
    span: str,
    *,
    new_id: Mapping[tuple[int, str], str],
    dropped: Mapping[tuple[int, str], Mapping[str, int]],
) -> Iterator[StyleLabels]:
    """The labels of each input under the merged scene ids, without the scenes and agents that were dropped."""
    for number, corpus in enumerate(corpora):
        labels = corpus.labels(method, span)
        keys = [(number, scene_id) for scene_id in labels.scene_id]
        keep = [
            row
            for row, (key, agent) in enumerate(zip(keys, labels.agent_id, strict=True))
            if key in new_id and agent not in dropped.get(key, {})
        ]
        yield _rows(labels, keep, [new_id[keys[row]] for row in keep])


def _rows(labels: StyleLabels, keep: list[int], scene_ids: list[str]) -> StyleLabels:
    index = np.array(keep, np.int64)
    arrays = ("start_frame", "stop_frame", "score", "style", "margin", "aggressiveness", "feature", "missing", "flags")
    chosen = {name: getattr(labels, name)[index] for name in arrays}
    for name in ("score_transposed", "style_transposed"):
        value = getattr(labels, name)
        chosen[name] = None if value is None else value[index]
    return replace(labels, scene_id=tuple(scene_ids), agent_id=tuple(labels.agent_id[row] for row in keep), **chosen)
