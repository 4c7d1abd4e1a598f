"""What helps drivers of rare styles: every option of `train` for them, compared over several seeds.

    python -m benchmarks.rare_styles [--size mini] [--steps 1000] [--seeds 5] [--out runs/rare_styles]

Trained on simulated everyday traffic (population `naturalistic`, where four of six styles are below 11 %), judged on
episodes in which all six are equally frequent, so that each has enough drivers. `+augment` takes 30 % of every batch
from other episodes of population `rare_heavy`. All arms have equal gradient steps. JTT trains its first model on top
of that. The worst style is chosen once, on validation episodes, from the arm without any option. The folder keeps
every finished run; the same command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch

from benchmarks.arms_table import print_table
from benchmarks.worlds import arm_options, folder_of, run, trained
from stylesim.corpus import Corpus
from stylesim.experiments.arms import Arm
from stylesim.experiments.results import Experiment
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import default_labeler
from stylesim.merging.merge import merge
from stylesim.simulation.generate import generate
from stylesim.windows import WindowSpec

SCENARIOS = ("yellow_light", "ramp_merge")
SPEC = WindowSpec(stride_s=12.0)  # chosen: a driver's windows do not overlap, and more drivers fit into the time
BASE = "none"
AUGMENT_SHARE = 0.3


def made(folder: Path, name: str, population: str, *, episodes: int, seed: int) -> Corpus:
    """Labelled episodes of every scenario."""
    out = folder / name
    corpus = generate(SCENARIOS, population, episodes=episodes, seed=seed, out=out, resume=True)
    if not corpus.has_labels("tdbm", "track"):
        label(corpus, default_labeler("tdbm"), spec=SPEC)
    return corpus


def divided(corpus: Corpus, shares: tuple[float, float, float]) -> Corpus:
    """The same episodes with splits."""
    out = corpus.path.with_name(corpus.path.name + "-split")
    return Corpus(out) if out.exists() else merge([corpus], split=shares, seed=0, out=out, spec=SPEC)


def arms(added: Corpus) -> list[Arm]:
    """Without anything, each option, and what goes together."""
    more = {"augment": added, "augment_share": AUGMENT_SHARE}
    return [
        Arm(BASE),
        Arm("balanced", {"robust": "balanced"}),
        Arm("group_dro", {"robust": "group_dro"}),
        Arm("jtt", {"robust": "jtt"}),
        Arm("cvar", {"robust": "cvar"}),
        Arm("augment", more),
        Arm("balanced+augment", {"robust": "balanced", **more}),
        Arm("group_dro+augment", {"robust": "group_dro", **more}),
    ]


def main() -> None:
    parser = arm_options(__doc__, seeds=5, steps=1000)
    parser.add_argument("--episodes", type=int, default=8, help="of each scenario, for training")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    out = folder_of(asked, "rare_styles")
    result = Experiment.load(out) if asked.show else made_and_trained(asked, out)
    for by in ("commanded", "tdbm"):
        print_table(result, BASE, by)


def made_and_trained(asked: argparse.Namespace, out: Path) -> Experiment:
    """Make the corpora and train what is missing."""
    train = divided(made(asked.out, "everyday", "naturalistic", episodes=asked.episodes, seed=1), (0.85, 0.15, 0.0))
    judged = divided(made(asked.out, "judged", "tdbm_spectrum", episodes=5, seed=2), (0.1, 0.3, 0.6))
    added = made(asked.out, "rare", "rare_heavy", episodes=asked.episodes, seed=3)
    return trained(asked, arms(added), train, out, spec=SPEC, test=judged, cache=asked.out / "cache")


if __name__ == "__main__":
    run(main)
