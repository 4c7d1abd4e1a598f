"""Writes fixtures/av2_metrics.json: what the functions of the `av2` package say of seeded arrays.

Run once in an environment of its own (av2 brings pyarrow and OpenCV, which metrics.py does not need):

    python -m venv ENV && ENV/bin/pip install numpy universal-pathlib && ENV/bin/pip install --no-deps av2==0.3.6
    ENV/bin/python tests/reference/make_av2_numbers.py tests/reference/fixtures/av2_metrics.json
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

SEED = 20240607
CASES = ((6, 60), (6, 60), (6, 30), (1, 60), (3, 80), (6, 1))  # (modes, steps)


def case(number: int, modes: int, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(modes, probabilities, truth) of one driver; PCG64 streams are the same in every numpy since 1.17."""
    rng = np.random.Generator(np.random.PCG64([SEED, number]))
    truth = np.cumsum(rng.normal(0.8, 0.3, (steps, 2)), axis=0)
    forecast = truth + np.cumsum(rng.normal(0.0, 0.15, (modes, steps, 2)), axis=1) + rng.normal(0, 0.5, (modes, 1, 2))
    chance = rng.random(modes) + 0.05
    return forecast, chance / chance.sum(), truth


def av2_numbers() -> list[dict[str, object]]:
    """One record per case."""
    from av2.datasets.motion_forecasting.eval import metrics

    records: list[dict[str, object]] = []
    for number, (modes, steps) in enumerate(CASES):
        forecast, chance, truth = case(number, modes, steps)
        fde = metrics.compute_fde(forecast, truth)
        best = int(fde.argmin())
        records.append(
            {
                "case": number,
                "modes": modes,
                "steps": steps,
                "checksum": float(forecast.sum() + truth.sum() + chance @ np.arange(modes)),
                "min_ade_m": float(metrics.compute_ade(forecast, truth).min()),
                "min_fde_m": float(fde[best]),
                "miss_rate": float(metrics.compute_is_missed_prediction(forecast, truth, 2.0)[best]),
                "brier_fde_m": float(metrics.compute_brier_fde(forecast, truth, chance)[best]),
                "top_fde_m": float(fde[chance.argmax()]),
                "best_mode": best,
            }
        )
    return records


def main(target: Path) -> None:
    """Write the fixture."""
    made = {"about": f"made with av2 {version('av2')}, numpy {np.__version__} by make_av2_numbers.py", "seed": SEED}
    target.write_text(json.dumps({**made, "records": av2_numbers()}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
