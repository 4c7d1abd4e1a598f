"""The paper's table: no style, or style by early, mid or late fusion, by the style of the whole track.

    python -m benchmarks.paper_table [--corpus simulated] [--seeds 5] [--steps 600] [--history 1] [--lr 0.003]

brierFDE / minADE / minFDE in metres, miss rate as a share; mean over drivers and seeds with its 95 % interval. The
paper's numbers (nuScenes, MTR, 6 s) stand beside; they are of another data set, another model and, for a style, of
two (threatening) and 143 (reckless) samples [computed], and can be compared in their order only. `--corpus` is
"simulated", or a recording of `benchmarks.dose_response` (dlr_ut, us101, dlr_ht; 2 s + 4 s, within one site). A
style of fewer than 30 test drivers is named and not shown. Resumable; runs of `benchmarks.style_helps` are used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks import dose_response
from benchmarks.tables import estimate_text
from benchmarks.worlds import SPEC, arm_options, folder_of, run, simulated, trained
from stylesim.corpus import Corpus
from stylesim.experiments.arms import Arm
from stylesim.experiments.results import Experiment
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import new_labeler

METRICS = {"brier_fde_m": "brierFDE", "min_ade_m": "minADE", "min_fde_m": "minFDE", "miss_rate": "miss rate"}
PAPER = {  # REFERENCE section 4 [paper]; it has no mid fusion
    ("threatening", "none"): "2.349 / .700 / 1.629 / .500",
    ("threatening", "early"): "1.977 / .393 / 1.066 / .000",
    ("threatening", "late"): "3.705 / 1.103 / 2.798 / .500",
    ("reckless", "none"): "5.209 / 1.686 / 4.541 / .671",
    ("reckless", "early"): "4.757 / 1.630 / 4.090 / .559",
    ("reckless", "late"): "4.893 / 1.566 / 4.158 / .524",
    ("overall", "none"): "5.170 / 1.673 / 4.501 / .669",
    ("overall", "early"): "4.719 / 1.612 / 4.048 / .552",
    ("overall", "late"): "4.877 / 1.559 / 4.139 / .524",
}


def arms(method: str) -> dict[str, Arm]:
    """By what the table calls them."""
    early = Arm(method, {"condition": method})
    others = {name: Arm(f"{method}-{name}", {"condition": method, "fusion": name}) for name in ("mid", "late")}
    return {"none": Arm("none"), "early": early, **others}


def recorded(name: str, data: Path, folder: Path, method: str) -> Corpus:
    """A recording with splits, and with labels of `method` fitted on its training part."""
    corpus = dose_response.recorded(name, data, folder)
    if not corpus.has_labels(method, "track"):
        spec = dose_response.SPEC
        label(corpus, new_labeler(method, history_s=(spec.history_s,)).fit(corpus.split("train")), spec=spec)
    return corpus


def show(runs: Experiment, method: str) -> None:
    named = {name: arm.name for name, arm in arms(method).items() if arm.name in runs.arms}
    print(
        "| style | fusion | "
        + " | ".join(METRICS.values())
        + " | minFDE to none, % | drivers / units / seeds | paper |"
    )
    print("|---" * (len(METRICS) + 5) + "|")
    small = []
    for style in ("overall", *runs.cells(method)):
        where: dict[str, Any] = {} if style == "overall" else {"by": method, "cell": style}
        for name, arm in named.items():
            means = [runs.mean(arm, metric=metric, **where) for metric in METRICS]
            size = means[0]
            if size.refused:
                small.append(f"{style} ({size.n_drivers})")
                break
            change = runs.difference(arm, "none", relative=True, **where)
            n = f"{size.n_drivers} / {size.n_units} / {size.n_seeds}"
            cells = [
                style,
                name,
                *map(estimate_text, means),
                "" if name == "none" else estimate_text(change, scale=100),
            ]
            print(f"| {' | '.join([*cells, n, PAPER.get((style, name), '')])} |")
    if small:
        print(f"\nToo few test drivers to show: {', '.join(small)}")


def main() -> None:
    parser = arm_options(__doc__, seeds=5, steps=400)
    parser.add_argument("--corpus", choices=("simulated", *dose_response.RECORDINGS), default="simulated")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    asked = parser.parse_args()
    simulation = asked.corpus == "simulated"
    method = "kdsc" if asked.corpus == "dlr_ht" else "tdbm"  # TDBM needs lanes
    out = folder_of(asked, "styles" if simulation else f"paper-{asked.corpus}")
    if not asked.show:
        if simulation:
            corpus = simulated(asked.out, "tdbm_spectrum")
        else:
            corpus = recorded(asked.corpus, asked.data, asked.out, method)
        trained(asked, list(arms(method).values()), corpus, out, spec=SPEC if simulation else dose_response.SPEC)
    show(Experiment.load(out), method)


if __name__ == "__main__":
    run(main)
