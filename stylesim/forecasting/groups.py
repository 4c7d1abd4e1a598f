"""The group of each training sample: measured style of its driver's track x context. No torch.

Groups weigh training samples; nothing here reaches the inputs of a network.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.corpus import Corpus
from stylesim.forecasting.conditioning import LEAST_IN_CELL
from stylesim.forecasting.samples import SPLITS
from stylesim.forecasting.store import SampleStore
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.merging.balance import MAX_WEIGHT, UNDETERMINED, require_labels

NO_GROUP = -1  # of validation samples
SMALL = "small groups"


@dataclass(frozen=True, eq=False)
class Groups:
    """Names of the groups, and the number of the group of each sample of a store (NO_GROUP: not for training)."""

    names: tuple[str, ...]
    number: Int64[np.ndarray, " sample"]


def sample_groups(corpora: Sequence[tuple[Corpus, SampleStore]], method: str) -> list[Groups]:
    """Groups of the training samples of corpora (as they were given to `compiled`), numbered alike in all of them.

    Drivers whose style `method` cannot determine are a group of their own. Groups of fewer than LEAST_IN_CELL samples
    are thrown together, because a network would learn them by heart. InputError where a corpus has no track labels.
    """
    texts = [_texts(corpus, store, method) for corpus, store in corpora]
    count = Counter(text for one in texts for text in one if text)
    large = sorted(name for name, n in count.items() if n >= LEAST_IN_CELL)
    names = (*large, SMALL) if len(large) < len(count) else tuple(large)
    place = {name: names.index(name if name in large else SMALL) for name in count} | {"": NO_GROUP}
    return [Groups(names, np.array([place[text] for text in one], np.int64)) for one in texts]


def _texts(corpus: Corpus, store: SampleStore, method: str) -> list[str]:
    """Style and context of the driver of each training sample, "" for the others."""
    require_labels(corpus, method)
    labels = corpus.labels(method, "track")
    group = {(labels.scene_id[i], labels.agent_id[i]): _name(labels, i) for i in range(len(labels))}
    view = corpus.with_info(info for info in corpus.info if info.split in SPLITS)
    training = (number for number, info in enumerate(view.info) if info.split == SPLITS[0])
    scenes = view.scenes(lambda info: info.split == SPLITS[0])
    ids = {number: (scene.scene_id, scene.tracks.agent_id) for number, scene in zip(training, scenes, strict=True)}
    return [
        "" if split else group.get((ids[scene][0], ids[scene][1][agent]), UNDETERMINED)
        for scene, _, agent, split in np.asarray(store.origin).tolist()
    ]


def _name(labels: StyleLabels, row: int) -> str:
    name = labels.class_name(row)
    where = "highway" if labels.flags[row] & LabelFlag.HIGHWAY else "elsewhere"
    return name if name == UNDETERMINED else f"{name}, {where}"


def balanced_weights(
    weight: Float64[np.ndarray, " row"], group: Int64[np.ndarray, " row"], names: Sequence[str]
) -> Float64[np.ndarray, " row"]:
    """Sampling weights under which every group is drawn equally often; within it rows keep their relative weights.

    As in `merging.balance`: no row gains more than MAX_WEIGHT, so that the share of a tiny group may be less, and the
    drivers of unknown style keep theirs, since nobody knows which share they should have.
    """
    total = np.bincount(group, weights=weight, minlength=len(names))
    known = (total > 0) & np.array([name != UNDETERMINED for name in names])
    fair = total[known].sum() / max(known.sum(), 1)
    factor = np.where(known, np.minimum(MAX_WEIGHT, fair / np.where(known, total, 1.0)), 1.0)
    return weight * factor[group]


def drawn_shares(
    weight: Float64[np.ndarray, " row"], group: Int64[np.ndarray, " row"], groups: int
) -> Float64[np.ndarray, " group"]:
    """Which share of the draws each group has; sums to 1."""
    return np.bincount(group, weights=weight, minlength=groups) / weight.sum()
