import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.datasets.motion import backward_velocity, courses
from stylesim.datasets.recording import NEVER


def tracks(seed, n=60):
    """Two agents that wander, stand and have gaps."""
    rng = np.random.default_rng(seed)
    parts = []
    for agent in range(2):
        speed = np.abs(rng.normal(6, 4, n)) * (rng.random(n) > 0.3)
        angle = np.cumsum(rng.normal(0, 0.1, n))
        step = speed[:, None] * 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        frame = np.cumsum(1 + (rng.random(n) > 0.95) * rng.integers(1, 20, n))
        parts.append((np.full(n, agent), frame, np.cumsum(step, axis=0)))
    agent, frame, position = (np.concatenate(p) for p in zip(*parts, strict=True))
    return agent.astype(np.int64), frame.astype(np.int64), position


def test_velocity_of_a_straight_drive_is_exact():
    frame = np.arange(10)
    position = np.stack([3.0 * frame * 0.1, np.zeros(10)], axis=1)
    velocity, ahead = backward_velocity(np.zeros(10, np.int64), frame, position, 0.1)
    np.testing.assert_allclose(velocity, np.tile([3.0, 0.0], (10, 1)))
    assert ahead.tolist() == [1, *[0] * 9]


def test_rows_alone_have_no_velocity():
    agent, frame = np.array([0, 1, 1, 1]), np.array([5, 0, 20, 21])
    velocity, ahead = backward_velocity(agent, frame, np.arange(8.0).reshape(4, 2), 0.1)
    assert np.isnan(velocity).all(axis=1).tolist() == [True, True, False, False]
    assert ahead.tolist() == [0, 0, 1, 0]


def test_course_of_a_turn_is_close_and_held_while_standing():
    angle = np.linspace(0, np.pi / 2, 100)
    arc = 20 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=1)
    position = np.concatenate([arc, np.tile(arc[-1], (50, 1))])
    heading, ahead = courses(np.zeros(150, np.int64), np.arange(150), position)
    np.testing.assert_allclose(heading[10:100], angle[10:], atol=0.06)
    np.testing.assert_allclose(heading[99:], heading[99])
    assert ahead[0] == ahead.max() > 0
    assert (ahead[4:] == 0).all()


def test_what_never_moves_has_no_course():
    heading, ahead = courses(np.zeros(5, np.int64), np.arange(5), np.full((5, 2), 7.0) + 0.1 * np.eye(5, 2))
    assert np.isnan(heading).all()
    assert (ahead == NEVER).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), cut=st.integers(1, 90))
def test_what_is_known_at_a_frame_does_not_depend_on_what_comes_later(seed, cut):
    agent, frame, position = tracks(seed)
    before = frame <= cut
    velocity, ahead_v = backward_velocity(agent, frame, position, 0.1)
    heading, ahead_h = courses(agent, frame, position)
    velocity_then, _ = backward_velocity(agent[before], frame[before], position[before], 0.1)
    heading_then, _ = courses(agent[before], frame[before], position[before])
    known = (frame + ahead_v <= cut)[before]
    np.testing.assert_array_equal(velocity[before][known], velocity_then[known])
    known = (frame + ahead_h <= cut)[before]
    np.testing.assert_array_equal(heading[before][known], heading_then[known])
