import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.datasets.cutting import cut
from stylesim.datasets.recording import NEVER, Recording, SignalLog, lookahead_of
from stylesim.datasets.resampling import decimated
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import TrackFlag


def recording(
    frames: dict[int, list[int]], *, dt_s: float = 0.05, made_up: tuple[tuple[int, int], ...] = ()
) -> Recording:
    """Agents with the given frames, driving east at 10 m/s."""
    rows = [(agent, frame) for agent in sorted(frames) for frame in frames[agent]]
    agent, frame = (np.array(column, np.int64) for column in zip(*rows, strict=True))
    n = len(frames)
    return Recording(
        recording_id="made", agent_id=tuple(f"a{i}" for i in range(n)), kind=np.ones(n, np.int8),
        size_m=np.ones((n, 2), np.float32), agent=agent, frame=frame,
        position_m=np.stack([10.0 * dt_s * frame, 5.0 * agent], axis=1).astype(np.float64),
        velocity_mps=np.tile([10.0, 0.0], (len(rows), 1)), heading_rad=np.zeros(len(rows)),
        lookahead=lookahead_of(agent, frame, np.array([row in made_up for row in rows])), dt_s=dt_s,
    )  # fmt: skip


def scenes_of(made: Recording, **options):
    return list(cut(made, source="made", scenario="s", unit_id="u", origin_m=np.zeros(2), **options))


def test_lookahead_stays_within_an_agent():
    agent = np.array([0, 0, 0, 0, 1, 1, 1])
    frame = np.array([0, 1, 4, 5, 0, 1, 2])
    made_up = np.array([False, True, True, False, True, False, True])
    assert lookahead_of(agent, frame, made_up).tolist() == [0, 4, 1, 0, 1, 0, NEVER]


def test_rows_must_be_sorted():
    with pytest.raises(ValueError, match="not sorted"):
        recording({0: [3, 2]})
    with pytest.raises(ValueError, match="not sorted"):
        recording({0: [2, 2]})


@settings(max_examples=40, deadline=None)
@given(st.sets(st.integers(1, 58), max_size=30), st.integers(0, 29))
def test_decimation_hides_exactly_what_depends_on_later_detections(made_up, t0):
    frames = list(range(60))
    slow = decimated(recording({0: frames}, made_up=tuple((0, f) for f in made_up)))
    (scene,) = scenes_of(slow)
    known = scene.history(t0, 60).tracks.valid[0]
    for step in range(t0 + 1):
        later = min((f for f in range(2 * step, 60) if f not in made_up), default=999)
        assert known[step] == (later <= 2 * t0)


def test_a_rate_that_does_not_divide_is_refused():
    with pytest.raises(InputError, match="does not divide"):
        decimated(recording({0: [0, 1]}, dt_s=1 / 29.97))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sets(st.integers(0, 700), min_size=1, max_size=60), min_size=1, max_size=4), st.floats(2.0, 30.0))
def test_every_row_is_in_one_scene_or_counted(frames, scene_s):
    made = recording({i: sorted(f) for i, f in enumerate(frames)})
    slow = decimated(made)
    found = scenes_of(slow, scene_s=scene_s)
    steps = sum(int(s.tracks.valid.sum()) for s in found)
    assert steps == len(slow.frame)
    if found:
        assert sum(s.counts["rows_in"] for s in found) == len(made.frame)


def test_a_jump_is_flagged_and_kept():
    made = recording({0: list(range(40)), 1: list(range(40))}, dt_s=0.1)
    moved = made.position_m.copy()
    moved[10:40] += 30.0
    jumping = Recording(**{**made.__dict__, "position_m": moved})
    (scene,) = scenes_of(jumping)
    assert scene.tracks.flagged(TrackFlag.IMPLAUSIBLE).tolist() == [True, False]
    assert scene.tracks.valid.all()


def test_signal_logs_never_tell_the_future():
    log = SignalLog(np.array([1.0, 2.0, 9.0]), ("a",), np.array([[2, 3, 4]], np.int8), stale_s=3.0)
    assert log.at(np.array([0.9, 1.0, 1.9, 2.0, 5.0, 5.1, 9.0])).tolist() == [
        [SignalState.UNKNOWN, 2, 2, 3, 3, SignalState.UNKNOWN, 4]
    ]
