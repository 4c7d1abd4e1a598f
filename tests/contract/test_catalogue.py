"""What every scenario of the catalogue promises: each stressor happens, finds nobody, or is refused; and replay."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from stylesim.corpus import Corpus
from stylesim.errors import InputError, MissingDependencyError
from stylesim.resources import scenarios_dir
from stylesim.scenario import scenarios
from stylesim.simulation.generate import generate
from stylesim.simulation.plan import EpisodePlan, stressors_of
from stylesim.simulation.replaying import replay

KINDS = ("hard_brake", "cut_in", "jaywalker", "deer", "stalled", "red_runner")
ONE_LANE = {"hw_two_way", "hw_roundabout", "roundabout", "intersection", "allway_stop", "priority"}  # no cut-in there
NO_CROSSING = {
    "highway",
    "hw_merge",
    "hw_exit",
    "hw_two_way",
    "motorway",
    "ramp_merge",
    "lane_drop",
    "roundabout",
}  # SUMO's roundabout is a ring of edges that others join

QUICK = ("hw_two_way",)  # the others in the slow run
LOG_S, MOST_WARM_UP_S = 40.0, 25.0


def possible(name: str) -> list[str]:
    """The kinds that the scenario's road can show, as the tables above say."""
    never = {"cut_in"} if name in ONE_LANE else set()
    never |= {"red_runner"} if name in NO_CROSSING else set()
    return [kind for kind in KINDS if kind not in never]


def shortened(name: str, folder: Path) -> str:
    """A copy of the scenario that logs 40 s."""
    shutil.copytree(scenarios_dir() / name, folder / name)
    path = folder / name / "scenario.yaml"
    raw: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    raw |= {"duration_s": LOG_S, "warm_up_s": min(raw["warm_up_s"], MOST_WARM_UP_S)}
    path.write_text(yaml.safe_dump(raw), encoding="utf-8")
    return str(folder / name)


@pytest.fixture(
    scope="module", params=[pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in sorted(scenarios())]
)
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, Corpus]:
    """Name, folder and a corpus with every possible stressor in both of its episodes."""
    name, folder = str(request.param), tmp_path_factory.mktemp("catalogue")
    scenario = shortened(name, folder)
    plan = EpisodePlan(stressors=stressors_of(",".join(possible(name))))
    try:
        corpus = generate(scenario, "tdbm_spectrum", episodes=2, seed=5, out=folder / "corpus", plan=plan)
    except (MissingDependencyError, ModuleNotFoundError) as error:
        pytest.skip(f"{name} cannot be run here: {error}")
    return name, scenario, corpus


def test_every_stressor_happens_or_finds_nobody_and_is_counted(made: tuple[str, str, Corpus]) -> None:
    name, _, corpus = made
    happened: set[str] = set()
    for scene in corpus:
        events = [event["kind"] for event in scene.metadata["events"]]
        for kind in possible(name):
            nobody = scene.counts.get(f"stressor.{kind}.nobody_fitted", 0)
            assert scene.counts.get(f"stressor.{kind}", 0) + nobody == 1, kind
            assert (kind in events) is (nobody == 0)
        happened |= set(events)
    assert happened, "nothing unusual in two episodes"


def test_what_the_road_can_never_show_is_refused(made: tuple[str, str, Corpus], tmp_path: Path) -> None:
    name, scenario, _ = made
    for kind in set(KINDS) - set(possible(name)):
        plan = EpisodePlan(stressors=stressors_of(kind))
        with pytest.raises(InputError, match=r"has one lane per direction|has no crossing"):
            generate(scenario, "tdbm_spectrum", episodes=1, seed=5, out=tmp_path / kind, plan=plan)
        assert not (tmp_path / kind).exists()


def test_an_episode_with_stressors_comes_out_again(made: tuple[str, str, Corpus]) -> None:
    _, scenario, corpus = made
    found = replay(corpus, "1", scenario=scenario)
    assert (found.identical, found.changed) == (True, ())
