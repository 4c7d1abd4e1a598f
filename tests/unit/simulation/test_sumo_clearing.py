"""Drivers who wait inside a junction leave it when their light is red."""

from __future__ import annotations

from pathlib import Path

import pytest

from stylesim.population import Population
from stylesim.scenario import Scenario, load_scenario
from stylesim.simulation.sumo.clearing import JunctionClearing
from stylesim.simulation.sumo.episode import prepare_episode
from stylesim.simulation.sumo.own import own_network
from tests.unit.simulation.own_maps import write_net

pytest.importorskip("libsumo", exc_type=ImportError)
from stylesim.simulation.sumo import SumoBackend


def stranded(scenario: Scenario, folder: Path) -> int:
    """Collisions of an episode in which a third of the drivers turns left against traffic."""
    files = prepare_episode(scenario, Population.load("rare_heavy"), seed=2, episode=2, folder=folder)
    backend = SumoBackend()
    log, _ = backend.simulate(files)
    backend.close()
    return len({frozenset(pair) for _, *pair in log.collisions})


@pytest.mark.slow
def test_nobody_is_hit_who_waited_to_turn_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario(str(own_network(write_net(tmp_path))))
    assert stranded(scenario, tmp_path) == 0
    with monkeypatch.context() as nobody_waits_for_them:
        nobody_waits_for_them.setattr(JunctionClearing, "turned_green", lambda self, signal, indices: None)
        assert stranded(scenario, tmp_path) > 0
    monkeypatch.setattr(JunctionClearing, "turned_red", lambda self, signal: None)
    assert stranded(scenario, tmp_path) > 0
