"""Programmes of signals: phases from plans, movements with directions, green waves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.road import Road
from stylesim.scenario import load_scenario
from stylesim.signals import SignalState
from stylesim.simulation.sumo.options import SignalPlan, sumo_options_of
from stylesim.simulation.sumo.roads import RoadNetwork, SignalLink
from stylesim.simulation.sumo.signals import programme_of, signal_log

pytest.importorskip("libsumo", exc_type=ImportError)
from stylesim.simulation.sumo import SumoBackend

TIMES = {"cycle_s": 60.0, "first_green_share": 0.5, "yellow_s": 3.0, "all_red_s": 1.0, "speed_limit_mps": 10.0}


def junction() -> RoadNetwork:
    """West and south come in with one lane each, and a pocket for left turns in the west."""
    links = [("west", 0, "s"), ("west", 1, "l"), ("south", 0, "s"), ("south", 0, "l")]
    made = [
        SignalLink("j", index, edge, f"{edge}_{lane}", direction) for index, (edge, lane, direction) in enumerate(links)
    ]
    return RoadNetwork(Road(()), tuple(made), {}, ("west", "south"))


def programme(*groups: tuple[str, ...], offset_share: float = 0.0, **more: object):
    return programme_of(SignalPlan(junction="j", groups=groups, **more), junction(), TIMES, offset_share=offset_share)


def test_two_groups_share_the_cycle() -> None:
    phases = programme(("west",), ("south",)).phases
    assert phases == (
        (26.0, "Ggrr"),
        (3.0, "yyrr"),
        (1.0, "rrrr"),
        (26.0, "rrGg"),
        (3.0, "rryy"),
        (1.0, "rrrr"),
    )


def test_a_movement_of_two_groups_keeps_its_green_in_between() -> None:
    phases = programme(("west:s",), ("west:sl",), ("south",), weights=(1.0, 3.0)).phases
    states = [state for _, state in phases]
    assert states[:3] == ["Grrr", "Grrr", "Grrr"]  # straight on goes on while the left turn gets its green
    assert states[3:6] == ["GGrr", "yyrr", "rrrr"]
    greens = [phases[index][0] for index in (0, 3, 6)]
    assert sum(duration for duration, _ in phases) == pytest.approx(60.0)
    assert greens[0] == pytest.approx(24.0)
    assert greens[2] - 5.0 == pytest.approx(3 * (greens[1] - 5.0), abs=0.2)


def test_greens_keep_five_seconds_in_a_cycle_that_is_too_short() -> None:
    short = {**TIMES, "cycle_s": 10.0}
    plan = SignalPlan(junction="j", groups=(("west:s",), ("west:l",), ("south",)))
    phases = programme_of(plan, junction(), short, offset_share=0.0).phases
    assert min(duration for duration, state in phases if "G" in state and "y" not in state) >= 5.0


def test_a_movement_that_is_not_there_is_named() -> None:
    with pytest.raises(InputError, match=r"no movement 'west:r'.*south, west"):
        programme(("west:r",), ("south",))
    with pytest.raises(InputError, match="no traffic light of that name"):
        programme_of(SignalPlan(junction="k", groups=(("west",), ("south",))), junction(), TIMES, offset_share=0.0)


def test_a_lane_shows_its_straight_movement() -> None:
    log = signal_log(junction(), {"j": (("rrrG", "rrGr"), np.array([0, 1], np.int32))})
    assert log is not None
    assert log.state[log.lane_id.index(("south_0",))].tolist() == [SignalState.RED, SignalState.GREEN]


def test_a_green_wave_runs_at_the_speed_limit() -> None:
    plan = SignalPlan(junction="j", groups=(("west",), ("south",)), wave_m=500.0)
    first, later = (programme_of(p, junction(), TIMES | {"speed_limit_mps": 16.0}, offset_share=0.0)
                    for p in (plan.model_copy(update={"wave_m": 0.0}), plan))  # fmt: skip
    assert (later.offset_s - first.offset_s) == pytest.approx(500.0 / 16.0 % sum(d for d, _ in later.phases), abs=0.11)


def test_half_a_cycle_lies_between_the_signals_of_the_corridor() -> None:
    scenario = load_scenario("corridor").model_copy(update={"warm_up_s": 0.0, "duration_s": 170.0})
    waves = {plan.junction: plan.wave_cycles for plan in sumo_options_of(scenario).signals}
    assert waves == {"one": 0.0, "two": 0.5, "three": 1.0}
    backend = SumoBackend()
    scene = backend.run_episode(scenario, Population.load("neutral"), seed=4, episode=0)
    backend.close()
    assert scene.signals is not None
    begins = {}
    for name in waves:
        state = scene.signals.state[scene.signals.lane_id.index((f"{name}_w_0",))]
        turned = np.flatnonzero((state[1:] == SignalState.GREEN) & (state[:-1] != SignalState.GREEN)) + 1
        begins[name] = turned * 0.1
    cycle = np.diff(begins["one"])[0]
    for name, cycles in waves.items():
        late = (begins[name][0] - begins["one"][0] + 0.5) % cycle - 0.5
        assert late == pytest.approx(cycles % 1.0 * cycle, abs=0.15)


def test_every_light_of_a_network_is_logged_and_asks_drivers(tmp_path: Path) -> None:
    scenario = load_scenario("corridor").model_copy(update={"warm_up_s": 60.0, "duration_s": 150.0})
    backend = SumoBackend()
    scene = backend.run_episode(scenario, Population.load("tdbm_spectrum"), seed=4, episode=1)
    backend.close()
    assert scene.signals is not None
    assert {name.split(":")[0] for name in scene.signals.signal_id} == {"one", "two", "three"}
    assert scene.counts["decided_stop"] > 5
    assert scene.counts["stopped_at_line"] > 5
