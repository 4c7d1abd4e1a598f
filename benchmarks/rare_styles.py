"""What helps drivers of rare styles: every option of `train` for them, compared over several seeds.

    python -m benchmarks.rare_styles --folder runs/rare_styles [--size mini] [--steps 1000] [--seeds 5]

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
from benchmarks.worlds import seeds_of, told
from stylesim.corpus import Corpus
from stylesim.experiments.arms import Arm
from stylesim.experiments.running import run_experiment
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--size", default="mini")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first-seed", type=int, default=0, help="so that two processes can share the seeds")
    parser.add_argument("--episodes", type=int, default=8, help="of each scenario, for training")
    parser.add_argument("--only", default="", help="names of arms, comma-separated")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    train = divided(made(asked.folder, "everyday", "naturalistic", episodes=asked.episodes, seed=1), (0.85, 0.15, 0.0))
    judged = divided(made(asked.folder, "judged", "tdbm_spectrum", episodes=5, seed=2), (0.1, 0.3, 0.6))
    added = made(asked.folder, "rare", "rare_heavy", episodes=asked.episodes, seed=3)
    chosen = [arm for arm in arms(added) if not asked.only or arm.name in asked.only.split(",")]
    result = run_experiment(
        chosen,
        corpus=train,
        test=judged,
        seeds=seeds_of(asked),
        steps=asked.steps,
        size=asked.size,
        spec=SPEC,
        out=asked.folder / f"{asked.size}-{asked.steps}",
        cache=asked.folder / "cache",
        progress=told,
    )
    for by in ("commanded", "tdbm"):
        print_table(result, BASE, by)


if __name__ == "__main__":
    main()
