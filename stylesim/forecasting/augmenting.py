"""Which scenes of another corpus may be added to a training, and what is said of it. No torch."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping
from dataclasses import dataclass, replace
from typing import Any

from stylesim.corpus import Corpus, SceneInfo
from stylesim.errors import InputError
from stylesim.merging.noise_fit import recorded_sources

TRAIN = "train"
RENAMED = re.compile(r"^c\d+-")  # `merge` puts this before ids that occur in two of its inputs


@dataclass(frozen=True, eq=False)
class Added:
    """A view of the scenes to add (all in split "train"), their share of every batch, and how many were left out."""

    corpus: Corpus
    share: float
    left_out: int

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        said = {"share": self.share, "scenes": len(self.corpus), "scenes_left_out": self.left_out}
        return {"corpus": self.corpus.fingerprint, **said}


def added_view(corpus: Corpus, augment: Corpus, share: float) -> Added:
    """The scenes of `augment` that a training on `corpus` may learn from.

    Left out: splits "val" and "test" of `augment`, scenes that go on from (or are twins of) a scene of `corpus` that
    is not in its training split, and scenes of `corpus` itself (generated ones of one id are the same if they have the
    same number of steps: another population drives other episodes under the same ids). InputError for the same corpus,
    a share outside [0, 1], other time steps, or nothing left.
    """
    if not 0 <= share <= 1:
        raise InputError(f"augment_share must be between 0 and 1, not {share}")
    if augment.fingerprint == corpus.fingerprint:
        raise InputError(f"{augment.path} is the corpus that is trained on; give another one to add")
    known = {RENAMED.sub("", info.scene_id): info for info in corpus.info}
    recorded = recorded_sources()
    kept = [replace(info, split=TRAIN) for info in augment.info if _may_be_seen(info, known, recorded)]
    if not kept:
        raise InputError(f"{augment.path} has no scene to add: all are of splits val and test, or of {corpus.path}")
    steps = {round(info.dt_s, 6) for info in kept} | {round(info.dt_s, 6) for info in corpus.info}
    if len(steps) > 1:
        raise InputError(
            f"{augment.path} and {corpus.path} have time steps {sorted(steps)}: bring them to one with `stylesim merge`"
        )
    return Added(augment.with_info(kept), share, len(augment) - len(kept))


def _may_be_seen(info: SceneInfo, known: Mapping[str, SceneInfo], recorded: Container[str]) -> bool:
    origins = [known.get(RENAMED.sub("", name)) for name in (info.replay_of, info.twin_of) if name]
    in_training = all(origin is None or origin.split == TRAIN for origin in origins)
    same = known.get(RENAMED.sub("", info.scene_id))
    itself = same is not None and (info.source in recorded or info.n_steps == same.n_steps)
    return info.split in ("", TRAIN) and in_training and not itself
