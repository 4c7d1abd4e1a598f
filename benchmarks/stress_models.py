"""What the stress test says of several forecasters: errors, the decisions, probabilities, twins, coverage, cost.

`python -m benchmarks.stress_models constant_velocity lane_following runs/model --folder runs/bench` simulates the
default traffic once into the folder (taken up again if it is there), examines all on the same questions, prints tables.
"""

from __future__ import annotations

import argparse
from itertools import chain
from pathlib import Path

from stylesim.evaluation.intervals import Estimate
from stylesim.evaluation.latency import Latency, latency
from stylesim.evaluation.results import interval_text
from stylesim.evaluation.slices import ALL
from stylesim.evaluation.stress_corpora import StressTraffic, fitting_traffic, generate_traffic
from stylesim.evaluation.stress_results import Stress
from stylesim.forecast import Forecaster
from stylesim.forecasting.opening import open_forecaster
from stylesim.report.stressing import stress
from stylesim.windows import WindowSpec


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("forecaster", nargs="*", default=["constant_velocity", "lane_following", "kinematic_fan"])
    parser.add_argument("--folder", type=Path, required=True, help="of the traffic and the report")
    parser.add_argument("--out", type=Path, help="of the report; FOLDER/report without it")
    parser.add_argument("--stride", type=float, default=12.0, help="seconds between the windows of a scene")
    parser.add_argument("--quick", action="store_true", help="3 episodes in place of 10")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    folder, spec = given.folder, WindowSpec(5.0, 6.0, given.stride)
    traffic = generate_traffic(folder, seed=given.seed, quick=given.quick, resume=True)
    fitting = lambda: chain(*fitting_traffic(folder, seed=given.seed))  # noqa: E731
    models = [open_forecaster(name, train=fitting, spec=spec) for name in given.forecaster]
    found = stress(models, traffic, out=given.out or folder / "report", spec=spec, seed=given.seed)
    tell(found, models, traffic, spec)


def tell(found: list[Stress], models: list[Forecaster], traffic: StressTraffic, spec: WindowSpec) -> None:
    """Every table as Markdown."""
    whole = found[0].evaluation.overall.size
    print(f"n = {whole.n_drivers} drivers of {whole.n_units} episodes, a window every {spec.stride_s:g} s\n")
    rows: dict[str, list[str]] = {}

    def row(name: str, values: list[Estimate | None], digits: int = 2) -> None:
        rows[name] = ["–" if value is None else interval_text(value, digits=digits) for value in values]

    for metric in ("min_fde_m", "miss_rate", "top_fde_m"):
        row(metric, [one.evaluation.overall.metrics[metric] for one in found])
    row("worst style x scenario, minFDE", [None if one.worst is None else one.worst.error_m for one in found])
    row("rare_heavy minus naturalistic, minFDE", [_rarely(one) for one in found])
    row("expected calibration error", [one.reliability[0].error if one.reliability else None for one in found], 3)
    for name in ("covered", "brier"):
        for cell in dict.fromkeys((c.kind, c.by, c.value) for c in found[0].decisions.cells if c.by in (ALL, "taken")):
            row(f"{': '.join((cell[0], cell[2]))}, {name}", [_decided(one, cell, name) for one in found])
    for twins in ("covers_own", "covers_twin", "covers_both"):
        row(f"switched at t0: {twins}", [None if one.twins is None else one.twins.figures[twins] for one in found])
    for pair in ("twin", "null"):
        for name in ("agrees", "share", "beyond_share"):
            row(f"from the start, {pair}: {name}", [_shift(one, pair, name) for one in found])
    print(f"| | {' | '.join(one.forecaster for one in found)} |\n|---{'|---' * len(found)}|")
    for name, texts in rows.items():
        print(f"| {name} | {' | '.join(texts)} |")
    same = ", ".join(f"{one.forecaster} {one.twins.identical} of {one.twins.drivers}" for one in found if one.twins)
    print(f"\nThe same forecast for both twins: {same}")
    every = [corpus for corpora in traffic.populations.values() for corpus in corpora]
    for model in models:
        print(f"{model.name}: {_cost(latency(model, every, spec=spec, beside=models))}")


def _rarely(one: Stress) -> Estimate | None:
    return one.degradation[0].change["min_fde_m"] if one.degradation else None


def _decided(one: Stress, cell: tuple[str, str, str], name: str) -> Estimate | None:
    return next((c.measures[name] for c in one.decisions.cells if (c.kind, c.by, c.value) == cell), None)


def _shift(one: Stress, pair: str, name: str) -> Estimate | None:
    return None if one.shift is None else one.shift.figures[pair][name]


def _cost(one: Latency | None) -> str:
    if one is None:
        return "nothing to ask"
    return (
        f"{one.cpu_median_ms:.1f} ms of CPU per scene (95 %: {one.cpu_p95_ms:.1f}), {one.scenes} scenes of "
        f"{one.drivers:.0f} drivers, {one.machine}"
    )


if __name__ == "__main__":
    main()
