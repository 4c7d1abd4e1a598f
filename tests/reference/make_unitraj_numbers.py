"""Writes fixtures/unitraj_metrics.json: UniTraj's metrics by their published definitions, in plain Python.

Nothing of UniTraj (AGPL) is imported or copied, and nothing of ours: lists, loops and `math` only. The definitions
[read: Feng et al. 2024, "UniTraj: A Unified Framework for Scalable Vehicle Trajectory Prediction", section 4, and what
its evaluation logs], for one agent with modes k = 1..6 of probability p_k and a future of which some steps are known:

* ADE_k: mean over the known steps of the Euclidean distance between mode k and the truth; minADE6 = min over k;
* FDE_k: that distance at the last known step, wherever unknown steps are; minFDE6 = min over k;
* miss rate: 1 where minFDE6 > 2.0 m (2.0 m itself is no miss), else 0;
* brier-minFDE: minFDE6 + (1 - p_k)^2, k the mode of minFDE6. Probabilities are not scaled.

The first four cases can be checked by hand: errors are sides of 3-4-5 triangles. The others are drawn by Python's own
generator, whose `random()` is the same in every version, and have gaps in the future.

    python tests/reference/make_unitraj_numbers.py tests/reference/fixtures/unitraj_metrics.json
"""

from __future__ import annotations

import json
import math
import random
import sys
from pathlib import Path
from typing import Any

SEED = 1964
MODES, STEPS, DRAWN = 6, 30, 5
DIGITS = 3  # of the coordinates in the file


def numbers(modes: list[Any], chance: list[float], truth: list[Any], valid: list[bool]) -> dict[str, float]:
    """The four metrics of one agent."""
    known = [step for step in range(len(truth)) if valid[step]]
    ade, fde = [], []
    for mode in modes:
        apart = [math.dist(mode[step], truth[step]) for step in known]
        ade.append(math.fsum(apart) / len(known))
        fde.append(apart[-1])
    best = fde.index(min(fde))
    return {
        "min_ade_m": min(ade),
        "min_fde_m": fde[best],
        "miss_rate": 1.0 if fde[best] > 2.0 else 0.0,
        "brier_fde_m": fde[best] + (1.0 - chance[best]) ** 2,
    }


def by_hand() -> list[dict[str, Any]]:
    """Three steps, one to three modes; what comes out is written behind each."""
    truth = [[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]
    near = [[1.0, 0.0], [2.0, 0.0], [3.0, 2.0]]  # off by 0, 0, 2
    far = [[4.0, 4.0], [5.0, 4.0], [6.0, 4.0]]  # off by 5 (3-4-5) at every step
    early = [[1.0, 1.0], [2.0, 1.0], [6.0, 4.0]]  # off by 1, 1, 5
    all_known, gap, cut = [True] * 3, [True, False, True], [True, True, False]
    return [
        # minADE 2/3, minFDE 2 is no miss, brier 2 + 0.75^2
        {"modes": [near, far], "chance": [0.25, 0.75], "truth": truth, "valid": all_known},
        # minADE 5, minFDE 5, miss, brier 5 + 0
        {"modes": [far], "chance": [1.0], "truth": truth, "valid": all_known},
        # the middle step is unknown: minADE (0 + 2) / 2 = 1, minFDE 2, brier 2 + 0.5^2
        {"modes": [near, far, early], "chance": [0.5, 0.25, 0.25], "truth": truth, "valid": gap},
        # the last step is unknown: `early` ends 1 m off; minADE 1, minFDE 1, brier 1 + 0.75^2
        {"modes": [far, early], "chance": [0.75, 0.25], "truth": truth, "valid": cut},
    ]


def drawn() -> list[dict[str, Any]]:
    """Wandering futures, modes that wander from them, unknown steps."""
    rng = random.Random(SEED)

    def wander(step_m: float, spread_m: float) -> list[list[float]]:
        x = y = 0.0
        path = []
        for _ in range(STEPS):
            x, y = x + step_m + spread_m * (rng.random() - 0.5), y + spread_m * (rng.random() - 0.5)
            path.append([round(x, DIGITS), round(y, DIGITS)])
        return path

    cases = []
    for case in range(DRAWN):
        truth = wander(0.8, 0.6)
        modes = [wander(0.8 + 0.05 * (k - 2.5) * case / 2, 0.6) for k in range(MODES)]
        chance = [rng.random() + 0.05 for _ in range(MODES)]
        chance = [p / math.fsum(chance) for p in chance]
        valid = [rng.random() < 0.6 for _ in range(STEPS)]
        valid[0] = True
        cases.append({"modes": modes, "chance": chance, "truth": truth, "valid": valid})
    return cases


def main(target: Path) -> None:
    """Write the fixture."""
    cases = by_hand() + drawn()
    records = [{**case, **numbers(case["modes"], case["chance"], case["truth"], case["valid"])} for case in cases]
    about = "made by make_unitraj_numbers.py from the published definitions; nothing of UniTraj was run"
    target.write_text(json.dumps({"about": about, "seed": SEED, "records": records}) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
