"""The labellers that ship: there, frozen, and not fitted on what they will judge."""

from __future__ import annotations

import json

import pytest

from stylesim.evaluation.fidelity_targets import HELD_TO_TARGET
from stylesim.labelers.reference import default_labeler, scalers_dir

DEMO_SEED = 7  # tools/demo.py


@pytest.mark.parametrize("method", ["tdbm", "kdsc"])
def test_a_reference_ships_with_its_provenance(method):
    assert default_labeler(method).method == method
    about = json.loads((scalers_dir() / f"sim-reference.{method}.json").read_text())["provenance"]
    assert about["corpus_seed"] not in (None, DEMO_SEED)
    assert len(about["corpus_fingerprint"]) == 64
    assert set(about["scenarios"]) == set(HELD_TO_TARGET)
