"""The corpora that the experiments on forecasters train and test on: made once, kept in a folder, found again there."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from stylesim.corpus import Corpus
from stylesim.labelers.labelling import label
from stylesim.labelers.reference import default_labeler
from stylesim.merging.merge import merge
from stylesim.population import Population
from stylesim.simulation.generate import generate
from stylesim.windows import WindowSpec

SCENARIOS = ("yellow_light", "ramp_merge")  # chosen: one where style decides to stop or go, one where it takes gaps
EPISODES = 24  # per scenario; chosen: 14 test units, and two minutes of CPU
SPLIT = (0.58, 0.12, 0.3)  # more in test than usual: the claims are about it
SPEC = WindowSpec(stride_s=12.0)  # chosen: windows of one driver that overlap less; about 25,000 samples
METHODS = ("tdbm", "kdsc")
ROOT = Path("runs") / "experiments"


def labelled(corpus: Corpus, spec: WindowSpec = SPEC) -> Corpus:
    """The corpus with TDBM and KDSC labels by the shipped references, made where they are missing."""
    for method in METHODS:
        if not corpus.has_labels(method, "history"):
            label(corpus, default_labeler(method), spec=spec)
    return corpus


def simulated(
    folder: Path, population: str, *, scenarios: Sequence[str] = SCENARIOS, episodes: int = EPISODES, seed: int = 11
) -> Corpus:
    """Traffic of that population with labels and splits by episode."""
    made, merged = folder / f"{population}-raw", folder / population
    if not merged.exists():
        if not made.exists():
            generate(list(scenarios), Population.load(population), episodes=episodes, seed=seed, out=made, resume=True)
        raw = labelled(Corpus(made))
        merge([raw], balance="none", split=SPLIT, seed=seed, out=merged)
    return labelled(Corpus(merged))


def options(description: str | None, *, seeds: int, steps: int, size: str = "tiny") -> argparse.ArgumentParser:
    """The command line that these benchmarks share."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT, help="corpora, models and results; a rerun goes on there")
    parser.add_argument("--seeds", type=int, default=seeds, help="training seeds, from 0")
    parser.add_argument("--first-seed", type=int, default=0, help="for a second process with other seeds")
    parser.add_argument("--steps", type=int, default=steps, help="batches of each training")
    parser.add_argument("--size", default=size, help="of the network: mini or tiny")
    parser.add_argument("--show", action="store_true", help="print what is there; train nothing")
    return parser


def told(name: str, done: int, total: int) -> None:
    """Say which run of an experiment is done."""
    print(f"{done}/{total} {name}", flush=True)


def seeds_of(asked: argparse.Namespace) -> range:
    """The training seeds that the command line asks for."""
    return range(asked.first_seed, asked.first_seed + asked.seeds)


if __name__ == "__main__":
    asked = options(__doc__, seeds=0, steps=0).parse_args()
    for crowd in ("tdbm_spectrum", "placebo"):
        found = simulated(asked.out, crowd)
        print(found.path, len(found), "scenes", {s: len(found.split(s)) for s in ("train", "val", "test")})
