"""The corpora that the experiments on forecasters train and test on: made once, kept in a folder, found again there."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import StylesimError, unknown
from stylesim.experiments.arms import Arm
from stylesim.experiments.results import Experiment
from stylesim.experiments.running import run_experiment
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


def options(description: str | None, *, seeds: int, steps: int, size: str = "mini") -> argparse.ArgumentParser:
    """The command line that the benchmarks of trainings share."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT, help="corpora, models and results; a rerun goes on there")
    parser.add_argument("--seeds", type=int, default=seeds, help="training seeds, from 0")
    parser.add_argument("--first-seed", type=int, default=0, help="for a second process with other seeds")
    parser.add_argument("--steps", type=int, default=steps, help="batches of each training")
    parser.add_argument("--size", default=size, help="of the network: mini or tiny")
    parser.add_argument("--history", type=float, help="seconds; the shorter, the less the motion itself tells of style")
    parser.add_argument("--lr", type=float, help="peak learning rate of all arms; that of train without it")
    parser.add_argument("--show", action="store_true", help="print what is there; train nothing")
    return parser


def arm_options(description: str | None, *, seeds: int, steps: int) -> argparse.ArgumentParser:
    """The same where the command line also chooses arms (`arms_of`)."""
    parser = options(description, seeds=seeds, steps=steps)
    parser.add_argument("--only", default="", help="names of arms, comma-separated; all without it")
    return parser


def spec_of(asked: argparse.Namespace, usual: WindowSpec = SPEC) -> WindowSpec:
    """The windows of a benchmark, with the history that the command line asks for."""
    return usual if asked.history is None else replace(usual, history_s=asked.history)


def arms_of(asked: argparse.Namespace, arms: Sequence[Arm]) -> list[Arm]:
    """The arms that the command line asks for, with its learning rate."""
    common: dict[str, Any] = {} if asked.lr is None else {"lr": asked.lr}
    only = [name for name in asked.only.split(",") if name]
    for name in only:
        if name not in {arm.name for arm in arms}:
            raise unknown("arm", name, [arm.name for arm in arms])
    return [replace(arm, options={**arm.options, **common}) for arm in arms if not only or arm.name in only]


def folder_of(asked: argparse.Namespace, name: str) -> Path:
    """Where the runs lie that were made as the command line asks; what runs have in common is in its name."""
    shorter = "" if asked.history is None else f"-history{asked.history:g}"
    faster = "" if asked.lr is None else f"-lr{asked.lr:g}"
    return Path(asked.out) / f"{name}-{asked.size}-{asked.steps}{shorter}{faster}"


def told(name: str, done: int, total: int) -> None:
    """Say which run of an experiment is done."""
    print(f"{done}/{total} {name}", flush=True)


def seeds_of(asked: argparse.Namespace) -> range:
    """The training seeds that the command line asks for."""
    return range(asked.first_seed, asked.first_seed + asked.seeds)


def trained(
    asked: argparse.Namespace, arms: Sequence[Arm], corpus: Corpus, out: Path, *, spec: WindowSpec = SPEC, **more: Any
) -> Experiment:
    """The arms that the command line asks for, trained as it asks; `more` as of `run_experiment`."""
    return run_experiment(
        arms_of(asked, arms),
        corpus=corpus,
        seeds=seeds_of(asked),
        steps=asked.steps,
        size=asked.size,
        spec=spec_of(asked, spec),
        out=out,
        progress=told,
        **more,
    )


def run(main: Callable[[], None]) -> None:
    """`main`; what is wrong with the data is said in a sentence, as the command line of stylesim does."""
    try:
        main()
    except StylesimError as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    asked = options(__doc__, seeds=0, steps=0).parse_args()
    for crowd in ("tdbm_spectrum", "placebo"):
        found = simulated(asked.out, crowd)
        print(found.path, len(found), "scenes", {s: len(found.split(s)) for s in ("train", "val", "test")})
