"""Sampling weights that make styles or sources equally frequent in training, without copying a row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TypeVar

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.labels import StyleLabels
from stylesim.tracks import Tracks

Key = TypeVar("Key")
ROW = tuple[str, str]  # (scene_id, agent_id)

BALANCES = ("none", "tdbm", "source")
# Chosen: one driver in twenty places of an epoch is as much as a rare style may be repeated before the network
# learns the driver instead of the style.
MAX_WEIGHT = 20.0
UNDETERMINED = "undetermined"


def equal_shares(group_of: Mapping[Key, str]) -> dict[Key, float]:
    """Weights under which each group has the same share; they average 1 unless the cap MAX_WEIGHT was reached.

    Those of the group "undetermined" keep the weight 1: nobody knows which share they should have.
    """
    counts = Counter(group for group in group_of.values() if group != UNDETERMINED)
    fair = sum(counts.values()) / max(len(counts), 1)
    return {
        key: 1.0 if group == UNDETERMINED else min(MAX_WEIGHT, fair / counts[group]) for key, group in group_of.items()
    }


def style_groups(labels: StyleLabels) -> dict[ROW, str]:
    """(scene_id, agent_id) -> measured class."""
    return {(labels.scene_id[i], labels.agent_id[i]): labels.class_name(i) for i in range(len(labels))}


def balance_weights(corpus: Corpus, by: str) -> dict[ROW, float]:
    """Weight of each (scene_id, agent_id) of the training split, `by` "tdbm" (or another method) or "source".

    InputError where the corpus has no training split, or lacks the track labels: it names the command to run.
    """
    train = corpus.split("train")
    if by == "source":
        agents = {(scene.scene_id, agent): scene.source for scene in train for agent in _motor(scene.tracks)}
        return equal_shares(agents)
    require_labels(corpus, by)
    return equal_shares(style_groups(train.labels(by, "track")))


def balance(corpus: Corpus, by: str) -> dict[ROW, float]:
    """Compute `balance_weights` and write them as a new file beside the corpus, in place of older ones.

    For corpora that were labelled after the merge (a noise model makes earlier labels void).
    """
    weights = balance_weights(corpus, by)
    corpus.write_weights(weights, by=by)
    return weights


def require_labels(corpus: Corpus, method: str) -> None:
    """InputError naming the command to run if the corpus has no track labels of that method."""
    if not corpus.has_labels(method, "track"):
        raise InputError(
            f"{corpus.path} has no {method} labels to balance by; run `stylesim label {corpus.path} --method {method}`"
        )


def check_balance(name: str) -> None:
    """InputError for an unknown way of balancing."""
    if name not in BALANCES:
        raise unknown("balance", name, BALANCES)


def _motor(tracks: Tracks) -> list[str]:
    return [agent for agent, motor in zip(tracks.agent_id, tracks.is_motor.tolist(), strict=True) if motor]
