import numpy as np
import pytest

from stylesim.datasets.light_links import crossing_times, infer_links, linked
from stylesim.datasets.recording import Recording, SignalLog
from stylesim.road import Lane, Road
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind

LANE = Lane(
    "in",
    np.array([[0.0, 0.0], [100.0, 0.0]]),
    width_m=3.5,
    stop_line_m=np.array([[80.0, -1.75], [80.0, 1.75]]),
)
NO_ORIGIN = np.zeros(2)


def cars(times, *, y=0.0, n_frames=200):
    """One car per time, whose front passes x = 80 m at 10 m/s then; each is seen for 14 s."""
    rows = [(i, f) for i, t in enumerate(times) for f in range(max(0, round(10 * t) - 70), round(10 * t) + 70)]
    agent, frame = (np.array(column, np.int64) for column in zip(*rows, strict=True))
    x = 80.0 - 2.25 + 10.0 * (frame / 10 - np.array(times)[agent])
    return Recording(
        recording_id="r",
        agent_id=tuple(str(i) for i in range(len(times))),
        kind=np.full(len(times), AgentKind.CAR, np.int8),
        size_m=np.tile(np.float32([4.5, 1.8]), (len(times), 1)),
        agent=agent,
        frame=frame,
        position_m=np.stack([x, np.full(len(x), y)], axis=1),
        velocity_mps=np.tile([10.0, 0.0], (len(x), 1)),
        heading_rad=np.zeros(len(x)),
        lookahead=np.zeros(len(x), np.int64),
        dt_s=0.1,
    )


def lights(**shown):
    """Lights from strings of one letter per second: G, Y, R."""
    code = {"G": SignalState.GREEN, "Y": SignalState.YELLOW, "R": SignalState.RED}
    state = np.array([[int(code[c]) for c in text] for text in shown.values()], np.int8)
    return SignalLog(np.arange(state.shape[1], dtype=float), tuple(shown), state, stale_s=5.0)


CYCLE = "R" * 20 + "G" * 10 + "Y" * 2 + "R" * 8
OTHER = "G" * 18 + "R" * 22
GREEN_S = [21.0, 24.5, 28.0, 31.0]


def with_times(times, **shown):
    return cars(times), lights(**{name: text * 5 for name, text in shown.items()})


def test_crossings_are_of_the_front_and_of_this_lane_only():
    np.testing.assert_allclose(crossing_times(cars([21.0, 30.5]), LANE, NO_ORIGIN), [21.0, 30.5], atol=1e-6)
    assert len(crossing_times(cars([21.0], y=3.5), LANE, NO_ORIGIN)) == 0


def test_the_light_that_the_crossings_follow_is_found():
    times = [t + 40 * k for k in range(5) for t in GREEN_S]
    recording, log = with_times(times, a=OTHER, b=CYCLE)
    (link,) = infer_links(recording, log, [LANE], NO_ORIGIN)
    assert (link.lane_id, link.signal_id, link.crossings) == ("in", "b", 20)
    assert link.confidence > 0.999


def test_one_who_runs_the_red_changes_nothing():
    times = [t + 40 * k for k in range(5) for t in GREEN_S] + [95.0]
    recording, log = with_times(times, a=OTHER, b=CYCLE)
    (link,) = infer_links(recording, log, [LANE], NO_ORIGIN)
    assert link.signal_id == "b"


@pytest.mark.parametrize(
    "times",
    [
        [21.0, 24.5, 28.0, 31.0],  # too few
        list(np.linspace(1, 190, 40)),  # at all times: nobody's light
    ],
)
def test_what_is_not_sure_stays_unknown(times):
    recording, log = with_times(times, a=OTHER, b=CYCLE)
    assert infer_links(recording, log, [LANE], NO_ORIGIN) == []


def test_two_lights_that_both_fit_leave_it_open_but_twins_do_not():
    times = [t + 40 * k for k in range(5) for t in GREEN_S]
    nearly = "R" * 19 + "G" * 11 + "Y" * 2 + "R" * 8
    recording, log = with_times(times, b=CYCLE, c=nearly)
    assert infer_links(recording, log, [LANE], NO_ORIGIN) == []
    recording, log = with_times(times, b=CYCLE, twin=CYCLE)
    (link,) = infer_links(recording, log, [LANE], NO_ORIGIN)
    assert link.signal_id == "b"


def test_links_go_into_the_log_and_what_was_found_is_counted():
    from dataclasses import replace

    times = [t + 40 * k for k in range(5) for t in GREEN_S]
    recording, log = with_times(times, a=OTHER, b=CYCLE)
    beside = replace(LANE, lane_id="beside", centre_line_m=LANE.centre_line_m + np.float32([0, 3.5]))
    found = linked(replace(recording, signals=log), Road((LANE, beside)), NO_ORIGIN)
    assert found.signals is not None
    assert found.signals.lane_id == ((), ("in",))
    assert (found.notes["light_links_inferred"], found.notes["light_links_unknown"]) == (1, 1)
    again = linked(found, Road((LANE,)), NO_ORIGIN)
    assert again.notes["light_links_inferred"] == 0  # known already
    assert linked(recording, Road((LANE,)), NO_ORIGIN) is recording
