"""The traffic of the stress test: edge cases in three scenarios, driven by two populations, and twins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from stylesim.corpus import Corpus
from stylesim.simulation.generate import generate
from stylesim.simulation.plan import EpisodePlan, Stressor, StressorKind, TwinRequest

# Those that the scenario can show (docs/stressors.md): a cut-in needs two lanes, a red-runner a crossing.
EDGE_CASES: Mapping[str, tuple[StressorKind, ...]] = {
    "yellow_light": ("cut_in", "hard_brake", "jaywalker", "red_runner"),
    "ramp_merge": ("cut_in", "hard_brake"),
    "roundabout": ("hard_brake", "jaywalker"),
}
EVERYDAY, RARE = "naturalistic", "rare_heavy"
TWINS, TWINS_FROM_START = "twins", "twins_from_start"
TWINS_AT_S = 20.0  # chosen: traffic has formed, and every scenario has minutes left
# Each kind of event happens once an episode: 10 episodes are 10 of each kind in each scenario and population.
EPISODES, QUICK_EPISODES = 10, 3  # chosen: 3 units make a cell general
# Chosen: one driver an episode in three scenarios. Of those that are switched on the way a third cannot be asked
# (gone within the future), of those from the start a few; 30 are needed.
TWIN_EPISODES, QUICK_TWIN_EPISODES = 20, 2
FITTING_EPISODES = 2  # chosen: thousands of windows, of which a kinematic fan learns two numbers for each of six arcs

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class StressTraffic:
    """Corpora by population (or the name of the user's own), and those that hold twins."""

    populations: Mapping[str, tuple[Corpus, ...]]
    twins: tuple[Corpus, ...]

    @property
    def paired(self) -> bool:
        """True where the same scenarios were driven by both populations."""
        return EVERYDAY in self.populations and RARE in self.populations


def own_traffic(corpus: Corpus) -> StressTraffic:
    """A corpus that the user has; its twins (scenes of `generate --twins-at`) are asked apart, as twins."""
    plain = corpus.with_info([info for info in corpus.info if not info.scene_id.endswith(("-twin", "-null"))])
    has_twins = len(plain) < len(corpus)
    return StressTraffic({corpus.path.name: (plain,)}, (corpus,) if has_twins else ())


def generate_traffic(
    out: str | Path,
    *,
    seed: int,
    quick: bool = False,
    workers: int = 1,
    resume: bool = False,
    progress: Progress | None = None,
) -> StressTraffic:
    """Simulate the edge cases into `out`/<population>-<scenario> and the twins into `out`/twins-<scenario>.

    Both populations drive the same scenarios with the same seed and stressors, so that what differs between them is
    who drives. Raises as `generate`; with `resume`, corpora that are there already are taken.
    """
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    episodes = QUICK_EPISODES if quick else EPISODES

    def made(kind: str, scenario: str, n: int, plan: EpisodePlan, twins: TwinRequest | None = None) -> Corpus:
        def tell(done: int, total: int) -> None:
            if progress is not None:
                progress(f"simulating {kind} {scenario}", done, total)

        people = kind if kind in (EVERYDAY, RARE) else RARE
        return generate(
            scenario, people, episodes=n, seed=seed, out=folder / f"{kind}-{scenario}", workers=workers, resume=resume,
            plan=plan, twins=twins, progress=tell,
        )  # fmt: skip

    def crowd(population: str) -> tuple[Corpus, ...]:
        return tuple(
            made(population, scenario, episodes, EpisodePlan(stressors=tuple(Stressor(kind=kind) for kind in kinds)))
            for scenario, kinds in EDGE_CASES.items()
        )

    populations = {population: crowd(population) for population in (EVERYDAY, RARE)}
    pairs = QUICK_TWIN_EPISODES if quick else TWIN_EPISODES
    twins = tuple(
        made(kind, scenario, pairs, EpisodePlan(), TwinRequest(at_s=at_s))
        for kind, at_s in ((TWINS, TWINS_AT_S), (TWINS_FROM_START, None))
        for scenario in EDGE_CASES
    )
    return StressTraffic(populations, twins)


def fitting_traffic(
    out: str | Path, *, seed: int, workers: int = 1, progress: Progress | None = None
) -> tuple[Corpus, ...]:
    """Everyday traffic of the same scenarios with other drivers, for what is fitted and must not see the examination.

    Its seed is the examination's plus 1, so no episode is in both. Raises as `generate`; what is there is taken.
    """
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for scenario in EDGE_CASES:
        tell = None if progress is None else partial(progress, f"simulating fitting {scenario}")
        found.append(
            generate(
                scenario, EVERYDAY, episodes=FITTING_EPISODES, seed=seed + 1, out=folder / f"fitting-{scenario}",
                workers=workers, resume=True, progress=tell,
            )
        )  # fmt: skip
    return tuple(found)
