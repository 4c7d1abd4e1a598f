"""The placebo test at size: does a forecaster gain from styles that have no effect?

    python -m benchmarks.placebo [--seeds 10] [--steps 400] [--size mini] [--out runs/experiments]

Two corpora of the same scenarios are made here: in one the six commanded styles drive as they do (the positive
control), in the other everybody drives as the neutral driver, and the style is a name only. A model that is told
nothing is trained in both, with the same seeds, steps and order of samples as one that is told the TDBM class of the
history and one that is told the commanded style. Printed: the relative change of the test minFDE against the first,
below 0 is a gain. Resumable: repeat the command; a second process may take other seeds (`--first-seed`).
"""

from __future__ import annotations

from benchmarks.tables import estimate_text
from benchmarks.worlds import folder_of, options, run, seeds_of, simulated, spec_of, told
from stylesim.experiments.placebo import CONTROL_WORLD, PLACEBO_WORLD, Placebo, placebo, placebo_of
from stylesim.experiments.results import Experiment

CONDITION = "tdbm"


def show(found: Placebo) -> None:
    print("| world | told | against | expected | change of minFDE, % | shown |\n|---|---|---|---|---|---|")
    for check in found.checks:
        wanted = {"nothing": f"within ± {100 * check.margin:g}", "gain": "below 0", "no gain": "no gain"}[check.expects]
        change = estimate_text(check.change, scale=100)
        cells = [check.world, check.arm, check.against, wanted, change, "yes" if check.passed else "no"]
        print(f"| {' | '.join(cells)} |")


def main() -> None:
    asked = options(__doc__, seeds=10, steps=400).parse_args()
    out = folder_of(asked, "placebo")
    if asked.show:
        found = placebo_of(out, condition=CONDITION)
    else:
        found = placebo(
            simulated(asked.out, "placebo"),
            simulated(asked.out, "tdbm_spectrum"),
            seeds=seeds_of(asked),
            steps=asked.steps,
            out=out,
            condition=CONDITION,
            size=asked.size,
            spec=spec_of(asked),
            lr=asked.lr,
            progress=told,
        )
    show(found)
    for name in (PLACEBO_WORLD, CONTROL_WORLD):
        runs = Experiment.load(out / name)
        mean = runs.mean("none")
        cost = sum(run.measured["train_cpu_s"] + run.measured["evaluate_cpu_s"] for run in runs.runs)
        print(
            f"{name}: {mean.n_seeds} seeds, {mean.n_drivers} drivers of {mean.n_units} units, minFDE of the model that "
            f"is told nothing {estimate_text(mean)} m; {cost / 60:.1f} min of CPU"
        )


if __name__ == "__main__":
    run(main)
