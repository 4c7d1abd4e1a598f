"""Sampling weights that make styles, contexts or sources equally frequent in training, without copying a row."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TypeVar

from stylesim.corpus import Corpus
from stylesim.errors import InputError, unknown
from stylesim.labelers.context import CONTEXTS
from stylesim.labels import LabelFlag, StyleLabels
from stylesim.tracks import Tracks

Key = TypeVar("Key")
ROW = tuple[str, str]  # (scene_id, agent_id)

CONTEXT = "context"
# "context": highway or not, as TDBM's labels have it; "tdbm+context": every class has the same share in either.
BALANCES = ("none", "tdbm", "kdsc", CONTEXT, f"tdbm+{CONTEXT}", f"kdsc+{CONTEXT}", "source")
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


def method_of(by: str) -> str:
    """The method whose labels are needed to balance by that."""
    return "tdbm" if by == CONTEXT else by.removesuffix(f"+{CONTEXT}")


def label_groups(labels: StyleLabels, by: str) -> dict[ROW, str]:
    """(scene_id, agent_id) -> measured class, context, or both, as `by` says.

    A class that nobody could determine stays "undetermined" in any context.
    """
    groups = {}
    for i in range(len(labels)):
        style = labels.class_name(i)
        context = CONTEXTS[int((labels.flags[i] & int(LabelFlag.HIGHWAY)) != 0)]
        both = style if style == UNDETERMINED else f"{style}, {context}"
        name = context if by == CONTEXT else both if by.endswith(f"+{CONTEXT}") else style
        groups[labels.scene_id[i], labels.agent_id[i]] = name
    return groups


def balance_weights(corpus: Corpus, by: str) -> dict[ROW, float]:
    """Weight of each (scene_id, agent_id) of the training split, `by` one of BALANCES.

    InputError for another one, where the corpus has no training split, or where it lacks the track labels: it names
    the command to run.
    """
    check_balance(by)
    if by == "none":
        return {}
    train = corpus.split("train")
    if by == "source":
        agents = {(scene.scene_id, agent): scene.source for scene in train for agent in _motor(scene.tracks)}
        return equal_shares(agents)
    method = method_of(by)
    require_labels(corpus, method)
    return equal_shares(label_groups(train.labels(method, "track"), by))


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
