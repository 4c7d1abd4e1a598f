"""What is drawn of stressors, what they leave in a scene, and the law of braking for somebody on foot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.errors import InputError
from stylesim.randomness import stream
from stylesim.road import Lane, Road
from stylesim.simulation.crossing import VERGE_M, barriers, lanes_crossed, meeting
from stylesim.simulation.plan import STRESSOR_KINDS, EpisodePlan, Stressor, stressors_of
from stylesim.simulation.stressors import Attempt, Event, Outcome, attempts, check_possible, with_events
from stylesim.simulation.walkers import Walker
from stylesim.simulation.yielding import HARDEST_MPS2, STOPS_BEFORE_M, Yield
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, TrackFlag
from tests.conftest import make_scene

ALL = EpisodePlan(stressors=stressors_of(",".join(STRESSOR_KINDS)))


def road(lanes=2, both_ways=True):
    """Lanes of 3.5 m along x; with `both_ways` one more beside them in the other direction."""
    line = np.stack([np.linspace(0, 400, 41), np.zeros(41)], axis=1)
    made = [Lane(f"a_{i}", line + np.array([0.0, 3.5 * i]), width_m=3.5) for i in range(lanes)]
    if both_ways:
        made.append(Lane("b_0", line[::-1] + np.array([0.0, 3.5 * lanes]), width_m=3.5))
    return Road(tuple(made))


def test_each_kind_is_tried_once_at_a_seeded_moment():
    first = attempts(ALL, seed=3, episode=4, duration_s=100.0)
    again = attempts(ALL, seed=3, episode=4, duration_s=100.0)
    assert [a.kind for a in first] == list(STRESSOR_KINDS)
    assert [(a.at_s, a.numbers) for a in first] == [(a.at_s, a.numbers) for a in again]
    assert all(15.0 <= a.at_s <= 60.0 for a in first)
    assert first[0].at_s != attempts(ALL, seed=3, episode=5, duration_s=100.0)[0].at_s
    alone = attempts(EpisodePlan(stressors=stressors_of("deer")), seed=3, episode=4, duration_s=100.0)
    assert alone[0].at_s == next(a for a in first if a.kind == "deer").at_s  # another kind shifts nothing


def test_a_share_is_the_share_of_episodes():
    plan = EpisodePlan(stressors=(Stressor(kind="deer", share=0.3),))
    hits = sum(bool(attempts(plan, seed=1, episode=episode, duration_s=60.0)) for episode in range(600))
    assert hits / 600 == pytest.approx(0.3, abs=0.06)


def test_what_a_road_cannot_show_is_refused():
    with pytest.raises(InputError, match=r"red_runner.*'s' has no crossing"):
        check_possible(EpisodePlan(stressors=stressors_of("red_runner")), road(), "s")
    with pytest.raises(InputError, match=r"cut_in.*one lane per direction"):
        check_possible(EpisodePlan(stressors=stressors_of("cut_in")), road(1), "s")
    check_possible(EpisodePlan(stressors=stressors_of("deer,jaywalker,stalled")), road(1), "s")


def test_crossed_lanes_are_those_side_by_side_with_their_own_places():
    found = lanes_crossed(road(), "a_0", 100.0)
    assert [item.lane.lane_id for item in found] == ["a_0", "a_1", "b_0"]
    assert [item.aside_m for item in found] == pytest.approx([0.0, 3.5, 7.0])
    assert [item.along_m for item in found] == pytest.approx([100.0, 100.0, 300.0])


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["jaywalker", "deer"]), st.integers(0, 500), st.floats(6.0, 33.0), st.sampled_from(["a_0", "a_1"])
)
def test_driver_and_walker_would_meet(kind, episode, speed_mps, lane):
    """Law: without braking the walker is in the middle of the lane `before_s` before the driver's front gets there."""
    plan = EpisodePlan(stressors=(Stressor(kind=kind),))
    (attempt,) = attempts(plan, seed=1, episode=episode, duration_s=60.0)
    met = meeting(attempt, road(), lane, from_m=20.0, speed_mps=speed_mps, now_s=10.0, name="w")
    if met is None:
        return
    own = next(item for item in met.crossed if item.lane.lane_id == lane)
    arrives_s = 10.0 + (own.along_m - 20.0) / speed_mps
    x, y = met.walker.position_m(arrives_s - attempt.numbers["before_s"])
    assert (x, y) == pytest.approx((own.along_m, own.lane.centre_line_m[0, 1]), abs=1e-3)
    ends = [met.walker.position_m(time)[1] for time in (met.walker.begin_s, met.walker.end_s)]
    assert min(ends) <= -1.75 - VERGE_M + 1e-3
    assert max(ends) >= 8.75 + VERGE_M - 1e-3
    for barrier in barriers(met):
        assert met.walker.begin_s <= barrier.from_s < barrier.until_s <= met.walker.end_s


def test_nobody_crosses_where_the_lane_ends():
    (attempt,) = attempts(EpisodePlan(stressors=stressors_of("jaywalker")), seed=1, episode=0, duration_s=60.0)
    assert meeting(attempt, road(), "a_0", from_m=380.0, speed_mps=14.0, now_s=1.0, name="w") is None


@settings(max_examples=60, deadline=None)
@given(st.floats(-1, 1), st.integers(0, 1000), st.floats(3.0, 25.0), st.floats(5.0, 150.0))
def test_a_driver_brakes_after_its_response_and_stops_where_it_can(knob, seed, speed_mps, gap_m):
    style = style_table().at(knob)
    law = Yield.begin("d", style, 0.0, stream(seed, 0, "d", "response"))
    time, speed, gap, before = 0.0, speed_mps, gap_m, 0.0
    while speed > 0 and gap > 0 and time < 60.0:
        wanted = law.deceleration(time, speed_mps=speed, gap_m=gap, dt_s=0.1)
        assert (wanted is None) == (time < law.acts_at_s)
        braking = 0.0 if wanted is None else wanted
        assert braking <= HARDEST_MPS2 + 1e-9
        assert abs(braking - before) <= 1.2 + 1e-9
        before = braking
        speed, gap, time = max(0.0, speed - braking * 0.1), gap - speed * 0.1, time + 0.1
    room = gap_m - STOPS_BEFORE_M - speed_mps * (law.acts_at_s + 0.8)
    if room > 0 and speed_mps**2 / (2 * room) < HARDEST_MPS2:
        assert gap > 0


def scene_and_walker(begin_s=5.0):
    """A scene of five cars, and a walker over the first one's path just where and when it is."""
    scene = make_scene(n_frames=130)
    x, y = scene.tracks.position_m[0, 60].astype(float)
    walker = Walker(
        "jaywalker-0", AgentKind.PEDESTRIAN, 0.5, 0.5, (x, y - 1.5), math.pi / 2, 1.5, begin_s, begin_s + 4.0
    )
    return scene, walker


def test_walkers_events_and_flags_are_in_the_scene():
    scene, walker = scene_and_walker()
    event = Event("jaywalker", 5.0, "jaywalker-0", "car-0", {"speed_mps": 1.5})
    plan = EpisodePlan(stressors=stressors_of("jaywalker,deer"))
    found = with_events(scene, Outcome((event,), (walker,), ("deer",)), plan)
    tracks, row = found.tracks, found.tracks.agent_id.index("jaywalker-0")
    assert (tracks.kind[row], tracks.driver[row]) == (AgentKind.PEDESTRIAN, None)
    assert TrackFlag(int(tracks.flags[row])) == TrackFlag.STRESSOR | TrackFlag.COLLIDED | TrackFlag.REMOVED
    assert TrackFlag(int(tracks.flags[0])) == TrackFlag.STRESSED | TrackFlag.COLLIDED
    last = np.flatnonzero(tracks.valid[row])[-1]
    assert 50 < last < 70
    assert np.isnan(tracks.position_m[row, last + 1 :]).all()
    assert found.metadata["events"] == (
        [{"kind": "jaywalker", "time_s": 5.0, "actor": "jaywalker-0", "victim": "car-0", "speed_mps": 1.5}]
    )
    assert (found.counts["stressor.jaywalker"], found.counts["stressor.deer.nobody_fitted"]) == (1, 1)
    assert (found.counts["walkers"], found.counts["walkers_hit"]) == (1, 1)
    assert found.counts["collisions"] == scene.counts["collisions"] + 1
    np.testing.assert_array_equal(tracks.position_m[:5], scene.tracks.position_m)


def test_who_is_missed_walks_on():
    scene, walker = scene_and_walker(begin_s=8.0)
    found = with_events(scene, Outcome((), (walker,), ()), EpisodePlan(stressors=stressors_of("jaywalker")))
    assert found.counts["walkers_hit"] == 0
    assert found.tracks.valid[-1].sum() == 41


def test_a_plain_episode_stays_as_it_is():
    scene = make_scene()
    assert with_events(scene, Outcome(), EpisodePlan()) is scene


def test_an_attempt_shows_no_generator():
    (attempt,) = attempts(EpisodePlan(stressors=stressors_of("deer")), seed=1, episode=0, duration_s=60.0)
    assert isinstance(attempt, Attempt)
    assert "Generator" not in repr(attempt)
