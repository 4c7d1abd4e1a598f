"""The placebo test: where styles have no effect, to know them must gain nothing; where they have, it must be found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import InputError
from stylesim.evaluation.seeded import EQUIVALENCE_LEVEL, SeededEstimate
from stylesim.experiments.arms import PERMUTED_ARM, Arm
from stylesim.experiments.results import METRIC, Experiment
from stylesim.experiments.running import run_experiment
from stylesim.windows import WindowSpec

MARGIN = 0.015  # of the relative gain, to be held by its 90 % interval: the project's own requirement
NONE, ORACLE = "none", "oracle"
PERMUTED_ORACLE = f"{ORACLE}{PERMUTED_ARM}"
PLACEBO_WORLD, CONTROL_WORLD = "placebo", "control"


@dataclass(frozen=True)
class Check:
    """One line of the test: the relative change of minFDE of an arm against another.

    `expects` is "nothing" (the 90 % interval lies within ± the margin), "gain" (the 95 % interval lies below 0) or
    "no gain" (the 90 % interval lies above - the margin: worse is allowed).
    """

    world: str
    arm: str
    against: str
    expects: str
    change: SeededEstimate
    margin: float

    @property
    def passed(self) -> bool:
        """True where what was expected was shown; an interval too wide to show anything does not pass."""
        if self.change.refused:
            return False
        if self.expects == "nothing":
            return self.change.within(self.margin)
        if self.expects == "gain":
            return self.change.high < 0
        return self.change.low > -self.margin

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        facts = {
            "world": self.world,
            "arm": self.arm,
            "against": self.against,
            "expects": self.expects,
            "margin": self.margin,
        }
        return {**facts, "passed": self.passed, "change": self.change.to_dict()}


@dataclass(frozen=True)
class Placebo:
    """All checks of one placebo test. Without its positive control nothing is shown: `passed` asks for all of them."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """True where every check passed."""
        return all(check.passed for check in self.checks)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"passed": self.passed, "checks": [check.to_dict() for check in self.checks]}


def placebo(
    world: Corpus,
    control: Corpus,
    *,
    seeds: Sequence[int],
    steps: int,
    out: str | Path,
    condition: str = "tdbm",
    fusion: str = "early",
    size: str = "tiny",
    lr: float | None = None,
    spec: WindowSpec = WindowSpec(),
    margin: float = MARGIN,
    cache: Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Placebo:
    """Train with and without styles in a world where they have no effect, and in one where they have.

    `world` was generated with the population "placebo" (commanded classes in name only), `control` with another; both
    need splits. In `world`, neither `condition` nor the commanded style (the oracle) may change the test minFDE; in
    `control`, the oracle must gain over the model that is told nothing and over itself with its labels permuted within
    scenario and context, and with these it must not gain. The folder `out` holds the runs; the same call again goes on.
    `lr` is the peak learning rate of all arms (None: that of `train`). InputError where `world` is no placebo or
    `control` is one.
    """
    check_worlds(world, control)
    common = {} if lr is None else {"lr": lr}
    none = Arm(NONE, common)
    told, oracle = (Arm(name, {"condition": name, "fusion": fusion, **common}) for name in (condition, ORACLE))
    plans = {
        CONTROL_WORLD: (control, [none, replace(oracle, permuted=True)]),
        PLACEBO_WORLD: (world, [none, told, oracle]),
    }
    for name, (corpus, arms) in plans.items():
        run_experiment(
            arms, corpus=corpus, seeds=seeds, steps=steps, out=Path(out) / name, splits=("test",), size=size,
            spec=spec, cache=cache, progress=progress,
        )  # fmt: skip
    return placebo_of(Path(out), condition=condition, margin=margin)


def placebo_of(out: Path, *, condition: str = "tdbm", margin: float = MARGIN) -> Placebo:
    """What the runs in a folder of `placebo` say so far; InputError where arms are missing."""
    worlds = {name: Experiment.load(out / name) for name in (PLACEBO_WORLD, CONTROL_WORLD)}
    wanted = (
        (PLACEBO_WORLD, condition, NONE, "nothing"),
        (PLACEBO_WORLD, ORACLE, NONE, "nothing"),
        (CONTROL_WORLD, ORACLE, NONE, "gain"),
        (CONTROL_WORLD, ORACLE, PERMUTED_ORACLE, "gain"),
        (CONTROL_WORLD, PERMUTED_ORACLE, NONE, "no gain"),
    )
    checks = []
    for name, arm, against, expects in wanted:
        level = 0.95 if expects == "gain" else EQUIVALENCE_LEVEL
        change = worlds[name].difference(arm, against, metric=METRIC, relative=True, level=level)
        checks.append(Check(name, arm, against, expects, change, margin))
    return Placebo(tuple(checks))


def check_worlds(world: Corpus, control: Corpus) -> None:
    """InputError unless the commanded styles of `world` have no effect and those of `control` have one."""
    if has_effect(world):
        raise InputError(
            f"{world.path} is no placebo: its styles have an effect; `stylesim generate ... --population placebo`"
        )
    if not has_effect(control):
        raise InputError(f"{control.path} cannot be the positive control: its styles have no effect")


def has_effect(corpus: Corpus) -> bool:
    """True where the commanded drivers of a corpus are at different places of the knob, by its first such scene.

    InputError where no driver is commanded.
    """
    for scene in corpus:
        places = {driver.aggressiveness for driver in scene.tracks.driver if driver is not None}
        if places:
            return places != {0.0}
    raise InputError(f"{corpus.path} has no commanded driver: the placebo test needs generated traffic")
