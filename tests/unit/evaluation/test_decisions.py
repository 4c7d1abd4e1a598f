"""Decisions in scenes that are made by hand, and forecasts that hold them or do not."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from stylesim.evaluation.decisions import FIRST_OR_SECOND, STOP_OR_GO, Decision, goes
from stylesim.evaluation.decisions_yellow import yellow_decisions_of
from stylesim.evaluation.decisions_yield import yield_decisions_of
from stylesim.evaluation.stress_decisions import SCHEMA, decision_cells, decisions
from stylesim.scene import Scene
from stylesim.tracks import AgentKind, Tracks
from stylesim.windows import WindowSpec

DT_S, STEPS = 0.1, 60


def drive(xy: list[np.ndarray], **others: object) -> Scene:
    """A scene of cars at those places, one per 0.1 s."""
    position = np.stack(xy)
    velocity = np.gradient(position, DT_S, axis=1)
    n = len(xy)
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(n)),
        kind=np.full(n, AgentKind.CAR),
        size_m=np.tile([4.0, 1.8], (n, 1)),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=np.arctan2(velocity[..., 1], velocity[..., 0]),
        valid=np.ones(position.shape[:2], bool),
        dt_s=DT_S,
    )
    base = {"scene_id": "s", "unit_id": "u", "source": "made", "scenario": "crossing"}
    return Scene(**base | others, tracks=tracks)


def along_x(x: np.ndarray, y: float = 0.0) -> np.ndarray:
    return np.stack([x, np.full(len(x), y)], axis=1)


def stopping(t: np.ndarray, start_m: float, pace: float, at_m: float, from_s: float) -> np.ndarray:
    """Goes at `pace`, then brakes evenly from `from_s` on to stand at `at_m`."""
    begin = start_m + pace * from_s
    braking = pace**2 / (2 * (at_m - begin))
    since = np.clip(t - from_s, 0, pace / braking)
    return start_m + pace * np.minimum(t, from_s) + pace * since - braking * since**2 / 2


@pytest.fixture
def yellow(world) -> Scene:
    """Yellow at 4 s, line at 150 m. Lane 0: goes, stops, behind it; lane 1: too near; lane 2: too far."""
    t = np.arange(150) * DT_S
    cars = [
        along_x(70 + 12 * t), along_x(stopping(t, 50, 13, 147, 5.0)), along_x(stopping(t, 30, 12, 140, 5.0)),
        along_x(95 + 13 * t, 3.5), along_x(-20 + 13 * t, 7.0),
    ]  # fmt: skip
    plain = world.scene(0)
    return drive(cars, road=plain.road, signals=plain.signals)


def test_stop_or_go_at_the_first_yellow_frame(yellow):
    counts: Counter[str] = Counter()
    found = list(yellow_decisions_of(yellow, STEPS, counts))
    assert [(one.agent, one.t0, one.taken) for one in found] == [(0, 40, "go"), (1, 40, "stop")]
    assert counts["at the yellow: behind one who stopped"] == 1
    assert counts["at the yellow: too near, too far or too slow to decide"] == 2


def test_a_short_future_asks_only_whom_it_can_see_over_the_line(yellow):
    """3 s: who needs more than 2 s to the line at its speed is not asked."""
    assert [one.agent for one in yellow_decisions_of(yellow, 30, Counter())] == []


def test_whose_track_ends_before_it_is_known_is_not_asked(yellow):
    valid = yellow.tracks.valid.copy()
    valid[1, 70:] = False
    gone = ~valid[..., None]
    tracks = replace(
        yellow.tracks,
        valid=valid,
        position_m=np.where(gone, np.nan, yellow.tracks.position_m),
        velocity_mps=np.where(gone, np.nan, yellow.tracks.velocity_mps),
        heading_rad=np.where(valid, yellow.tracks.heading_rad, np.nan),
    )
    counts: Counter[str] = Counter()
    assert [one.agent for one in yellow_decisions_of(replace(yellow, tracks=tracks), STEPS, counts)] == [0]
    assert counts["at the yellow: track ends within the future"] == 1


def crossing(late_s: float, **others: object) -> Scene:
    """Two ways that cross at the origin, the second car there `late_s` after the first (at 10 s)."""
    t = np.arange(200) * DT_S
    first = along_x(8 * (t - 10.0))
    second = along_x(8 * (t - 10.0 - late_s))[:, ::-1]
    return drive([first, second], **others)


def test_both_drivers_of_a_meeting_decide():
    found = list(yield_decisions_of(crossing(1.2), STEPS, Counter()))
    assert [(one.agent, one.taken) for one in found] == [(0, "first"), (1, "yield")]
    first, second = found
    assert first.t0 == second.t0
    assert first.t0 * DT_S == pytest.approx(10.0 - 4.5, abs=0.31)  # the first moment with both arrivals in 6 s
    assert first.station_m == pytest.approx(8 * (10.0 - first.t0 * DT_S), abs=2.5)  # the grid is one of 2 m


def test_nobody_decides_who_comes_much_later_or_follows():
    counts: Counter[str] = Counter()
    assert list(yield_decisions_of(crossing(4.0), STEPS, counts)) == []
    t = np.arange(200) * DT_S
    behind = drive([along_x(8 * t), along_x(8 * t - 12)])
    assert list(yield_decisions_of(behind, STEPS, counts)) == []
    fast = drive([along_x(30 * (t - 10)), along_x(3 * (t - 12.0))[:, ::-1]])  # 3 m/s cannot get there before it
    assert list(yield_decisions_of(fast, STEPS, counts)) == []
    assert counts["ways that meet: the order was never open"] == 1


def test_an_event_is_known_by_its_pair():
    event = {"kind": "red_runner", "time_s": 5.0, "actor": "car1", "victim": "car0"}
    assert all(
        one.with_event for one in yield_decisions_of(crossing(1.0, metadata={"events": [event]}), STEPS, Counter())
    )


def test_a_mode_goes_if_it_is_past_the_place_in_time():
    way = np.array([[0.0, 0.0], [100.0, 0.0]])
    one = Decision(FIRST_OR_SECOND, 0, 0, way, 20.0, 30, True)
    t = np.arange(1, 61)[:, None] * DT_S
    modes = np.stack([np.hstack([v * t, 0 * t]) for v in (5.0, 7.0, 10.0)])
    np.testing.assert_array_equal(goes(one, modes), [False, True, True])  # 3 s: 15, 21 and 30 m
    late = Decision(STOP_OR_GO, 0, 0, way, 20.0, 60, True)
    np.testing.assert_array_equal(goes(late, modes), [True, True, True])


def test_mass_and_coverage_of_a_forecast(world, tmp_path):
    """Modes at 1.0 and 0.2 of the speed: the one goes over the line, the other does not."""
    t = np.arange(150) * DT_S
    plain = world.scene(0)
    scenes = []
    for e in range(36):
        cars = [along_x(70 + 12 * t), along_x(stopping(t, 50, 13, 147, 5.0), 3.5)]
        scenes.append(
            drive(cars, road=plain.road, signals=plain.signals, scene_id=f"s{e}", unit_id=f"u{e}", source="sumo")
        )
    corpus = world.write(tmp_path / "yellow", scenes, with_labels=False)

    class Both(world.ConstantVelocity):
        def _one(self, task):
            given = super()._one(task)
            return replace(given, probability=np.tile([0.75, 0.25], (len(given.probability), 1)))

    found = decisions(Both((1.0, 0.2)), {"mine": (corpus,)}, spec=WindowSpec(), modes=6, seed=0)
    cells = {(one.by, one.value): one for one in found.cells}
    go, stop = cells["taken", "go"], cells["taken", "stop"]
    assert (go.decisions, stop.decisions) == (36, 36)
    assert go.measures["covered"].value == stop.measures["covered"].value == 1.0
    assert (go.measures["mass"].value, stop.measures["mass"].value) == pytest.approx((0.75, 0.25))
    assert (go.measures["top_right"].value, stop.measures["top_right"].value) == (1.0, 0.0)
    assert cells["all", "all"].measures["brier"].value == pytest.approx((0.0625 + 0.5625) / 2)
    assert cells["all", "all"].guessing == pytest.approx(0.25)
    only = decisions(world.ConstantVelocity((1.0,)), {"mine": (corpus,)}, spec=WindowSpec(), modes=6, seed=0)
    missed = {one.value: one.measures["covered"].value for one in only.cells if one.by == "taken"}
    assert missed == {"go": 1.0, "stop": 0.0}
    assert set(found.table["unit_id"].str.split(":").list.first()) == {"mine"}


def test_without_decisions_there_is_no_cell():
    assert decision_cells(pl.DataFrame(schema=SCHEMA), seed=0) == ()
