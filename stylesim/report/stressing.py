"""`stylesim.stress`: several forecasters through the stress test, and the folder of its report."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from stylesim.corpus.files import new_folder
from stylesim.errors import InputError
from stylesim.evaluation.evaluate import common_spec
from stylesim.evaluation.latency import latency
from stylesim.evaluation.stress import stress as one_forecaster
from stylesim.evaluation.stress_corpora import StressTraffic
from stylesim.evaluation.stress_results import Stress
from stylesim.forecast import Forecaster
from stylesim.report.stress_page import save_stress
from stylesim.windows import WindowSpec


def stress(
    forecasters: Sequence[Forecaster],
    traffic: StressTraffic,
    *,
    out: str | Path,
    spec: WindowSpec | None = None,
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Stress]:
    """Stress-test all on the same questions; `out`/report.html and the JSON files come whole or not at all.

    InputError if there is none, two have one name, or `out` is there.
    """
    names = [one.name for one in forecasters]
    if not names or len(set(names)) < len(names):
        raise InputError(f"give forecasters of different names, not {', '.join(names) or 'none'}")
    final, partial = new_folder(out)
    shutil.rmtree(partial, ignore_errors=True)  # of a run that was killed
    try:
        found = [
            one_forecaster(one, traffic, spec=spec, seed=seed, beside=forecasters, progress=progress)
            for one in forecasters
        ]
        every = [corpus for corpora in traffic.populations.values() for corpus in corpora]
        judged = common_spec(forecasters, spec or WindowSpec())
        timed = {one.name: latency(one, every, spec=judged, beside=forecasters) for one in forecasters}
        known = {name: one for name, one in timed.items() if one is not None}
        save_stress(found, partial / "report.html", latencies=known)
        partial.rename(final)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return found
