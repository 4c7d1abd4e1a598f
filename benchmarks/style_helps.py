"""Does it help a forecaster to be told the style that the history shows? On whom, and compared to what?

    python -m benchmarks.style_helps [--seeds 5] [--steps 600] [--history 1] [--lr 0.003] [--out runs/experiments]

Simulated traffic of all six styles. Told: the TDBM class of the history, or of the history and earlier windows of the
same driver (20 s of them, which count most where the history is short). Against: nothing; the raw features of TDBM and
KDSC in place of the class; a class by lot; and, for the earlier windows, their raw features. All have the same number
of parameters, start weights, order of samples and steps.

The baseline that counts is the one with the least minFDE on validation, and the style that is followed is the one in
which the model that is told nothing is worst on validation; both are chosen once, the claims are read from test. The
oracle, told the commanded style, shows what there is to gain at this length of training; no claim is made of it, for it
sees the future. "No worse" is shown where the 95 % interval of the change lies below the margin of the placebo test;
an interval that includes 0 does not show it.
Resumable: repeat the command; a second process may take other seeds (`--first-seed`).
"""

from __future__ import annotations

from benchmarks.tables import estimate_text
from benchmarks.worlds import arm_options, folder_of, run, simulated, trained
from stylesim.experiments.arms import Arm
from stylesim.experiments.placebo import MARGIN
from stylesim.experiments.results import Experiment

BY = "commanded"
TOLD = {"tdbm": ("none", "features", "random"), "earlier": ("none", "features", "random", "earlier_features")}
ARMS = ("none", "tdbm", "features", "random", "earlier", "earlier_features", "oracle")


def arms() -> list[Arm]:
    """One for each condition."""
    return [Arm("none")] + [Arm(name, {"condition": name}) for name in ARMS[1:]]


def show(runs: Experiment) -> None:
    have = [arm for arm in runs.arms if "+" not in arm]
    print("| told | parameters | steps | seeds | minFDE on val, m | on test, m | change to none, % |")
    print("|---|---|---|---|---|---|---|")
    for arm in have:
        cells = [arm, *(_one(runs.measured(arm, name)) for name in ("parameters", "steps")), str(len(runs.seeds(arm)))]
        cells += [estimate_text(runs.mean(arm, split=split)) for split in ("val", "test")]
        cells.append("" if arm == "none" else estimate_text(runs.difference(arm, "none", relative=True), scale=100))
        print(f"| {' | '.join(cells)} |")
    worst = runs.worst("none", BY)
    drivers, units = runs.cells(BY)[worst]
    print(f"\nWorst {BY} style of `none` on val: {worst} ({drivers} drivers of {units} units on test)\n")
    print("| claim | against (best on val) | drivers | change of minFDE on test, % | target | met |")
    print("|---|---|---|---|---|---|")
    for arm, baselines in TOLD.items():
        present = [name for name in baselines if name in have]
        if arm not in have or not present:
            continue
        best = min(present, key=lambda name: runs.mean(name, split="val").value)
        inside = runs.difference(arm, best, by=BY, cell=worst, relative=True)
        overall = runs.difference(arm, best, relative=True)
        for what, found, target, met in (
            (f"{worst} drivers", inside, "below 0", inside.high < 0),
            ("all drivers", overall, f"no worse: below +{100 * MARGIN:g}", overall.high < MARGIN),
        ):
            n = f"{found.n_drivers} of {found.n_units} units, {found.n_seeds} seeds"
            text = estimate_text(found, scale=100)
            print(f"| {arm}, {what} | {best} | {n} | {text} | {target} | {'yes' if met else 'no'} |")


def _one(values: list[int]) -> str:
    """The value that all runs share, or all that there are."""
    return ", ".join(f"{value:,}" for value in sorted(set(values)))


def main() -> None:
    asked = arm_options(__doc__, seeds=5, steps=400).parse_args()
    out = folder_of(asked, "styles")
    if not asked.show:
        trained(asked, arms(), simulated(asked.out, "tdbm_spectrum"), out)
    show(Experiment.load(out))


if __name__ == "__main__":
    run(main)
