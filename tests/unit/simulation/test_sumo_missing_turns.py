"""Who stands at the end of a wrong lane goes where that lane leads."""

from __future__ import annotations

from typing import Any
from unittest.mock import Mock

import pytest

from stylesim.simulation.sumo.episode import Episode
from stylesim.simulation.sumo.missing_turns import LAST_M, SLOW_MPS, MissedTurns

# in_1 leads straight to out (and left to side); in_0 right to alley. out goes on to far and from there round to out.
LINKS = {
    "in_1": [("side_0", "l"), ("out_0", "s")],
    "in_0": [("alley_0", "r")],
    "out_0": [("far_0", "s")],
    "far_0": [("out_0", "s")],
    "side_0": [],
    "alley_0": [],
}


def world(
    *, lane: str, route: tuple[str, ...], place_m: float = 99.0, speed_mps: float = 0.0
) -> tuple[MissedTurns, list[Any]]:
    """One driver, "a", on a lane of 100 m, and the routes that it is given."""
    given: list[Any] = []
    sumo = Mock()
    sumo.lane = Mock(
        getLastStepVehicleIDs=lambda name: ["a", "somebody else"] if name == lane else [],
        getLinks=lambda name: [(to, True, True, False, "", "G", way, 10.0) for to, way in LINKS[name]],
    )
    sumo.vehicle = Mock(
        getLanePosition=lambda name: place_m,
        getSpeed=lambda name: speed_mps,
        getRoute=lambda name: route,
        getRouteIndex=lambda name: 0,
        setRoute=lambda name, edges: given.append((name, edges)),
    )
    files = Mock(spec=Episode, drivers={"a": None})
    files.network = Mock(length_m=dict.fromkeys(LINKS, 100.0), controlled_lanes=lambda: ("in_0", "in_1"))
    return MissedTurns(sumo, files), given


def test_it_goes_straight_on_until_the_network_ends_or_the_way_would_meet_itself() -> None:
    missed, given = world(lane="in_1", route=("in", "alley"))
    missed.before_step(0)
    assert given == [("a", ["in", "out", "far"])]
    assert missed.events == [(0, "a")]


@pytest.mark.parametrize(
    "case",
    [
        {"lane": "in_1", "route": ("in", "side")},  # on the right lane
        {"lane": "in_0", "route": ("in",)},  # at its destination
        {"lane": "in_1", "route": ("in", "alley"), "place_m": 100.0 - LAST_M - 1.0},
        {"lane": "in_1", "route": ("in", "alley"), "speed_mps": SLOW_MPS + 1.0},
    ],
)
def test_everybody_else_keeps_its_way(case: dict[str, Any]) -> None:
    missed, given = world(**case)
    missed.before_step(0)
    assert given == []
    assert missed.events == []


def test_it_looks_every_fifth_step() -> None:
    missed, given = world(lane="in_1", route=("in", "alley"))
    missed.before_step(3)
    assert given == []
