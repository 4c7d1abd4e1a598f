"""Fits the shipped `sim-reference` labellers: neutral drivers, calibration seed, pooled over the target scenarios.

    .venv/bin/python tools/make_reference.py [--episodes 6] [--workers 2]

The scenarios are those that are held to the fidelity targets, on both simulators: style is how one drives compared to
the average driver in such traffic, so a scaler of other regimes would shift every class.

Writes agents/scalers/sim-reference.{tdbm,kdsc}.json; the provenance inside names the corpus and its seed. Corpora that
are judged must not have this seed (`CALIBRATION_SEED`).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from stylesim.evaluation.fidelity_targets import HELD_TO_TARGET
from stylesim.labelers.reference import fit_reference
from stylesim.simulation.generate import generate

CALIBRATION_SEED = 990_001


def main() -> None:
    """Generate, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=6)
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "neutral"
        corpus = generate(
            HELD_TO_TARGET, "neutral", episodes=asked.episodes, seed=CALIBRATION_SEED, out=out, workers=asked.workers
        )
        for path in fit_reference(corpus, "sim-reference"):
            sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
