"""Which groups are held to a target, and when it is met."""

from __future__ import annotations

import numpy as np

from stylesim.evaluation.fidelity_agreement import Agreement
from stylesim.evaluation.fidelity_targets import targets_of, verdict
from stylesim.evaluation.intervals import Estimate
from stylesim.style import STYLE_CLASSES


def agreement(group: str, per_class: int, **values: float) -> Agreement:
    estimates = {name: Estimate(v, v - 0.01, v + 0.01, 6 * per_class, 10, "general") for name, v in values.items()}
    count = np.eye(6) * per_class
    return Agreement(group, "tdbm", "sim-reference", "track", STYLE_CLASSES, count, estimates, 10)


def test_groups_and_their_targets():
    assert targets_of("sumo: motorway")["balanced_accuracy"] == 0.80
    assert targets_of("highway_env: hw_exit")["balanced_accuracy"] == 0.75
    assert targets_of("sumo: held to the target") == targets_of("sumo: yellow_light")
    assert targets_of("sumo: roundabout") == targets_of("all drivers") == targets_of("sumo: all") == {}


def test_met_missed_and_too_few():
    good = {"balanced_accuracy": 0.78, "kappa": 0.85, "knob_to_a": 0.9}
    assert verdict(agreement("highway_env: highway", 500, **good)) == "met"
    assert verdict(agreement("sumo: motorway", 500, **good)) == "missed"
    assert verdict(agreement("highway_env: highway", 60, **good)) == "met, n < 500 per class"
    assert verdict(agreement("sumo: priority", 500, **good)) == ""
    none = Estimate(float("nan"), float("nan"), float("nan"), 12, 2, "too few")
    refused = agreement("sumo: motorway", 2)
    refused = Agreement(**{**vars(refused), "estimates": dict.fromkeys(good, none)})
    assert verdict(refused) == "missed, n < 500 per class"
