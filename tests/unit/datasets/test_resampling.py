import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stylesim.datasets.recording import NEVER, Recording, SignalLog
from stylesim.datasets.resampling import carried, on_clock
from stylesim.tracks import AgentKind


def driven(rate_hz, *, n=200, first=0, a=1.5, lookahead=None, signals=None):
    """One car with constant acceleration and turn rate."""
    t = np.arange(n) / rate_hz
    zero = np.zeros(n)
    return Recording(
        recording_id="r",
        agent_id=("1",),
        kind=np.array([AgentKind.CAR], np.int8),
        size_m=np.array([[4.5, 1.8]], np.float32),
        agent=np.zeros(n, np.int64),
        frame=np.arange(n) + first,
        position_m=np.stack([5 * t + a * t**2 / 2, zero], axis=1),
        velocity_mps=np.stack([5 + a * t, zero], axis=1),
        heading_rad=0.2 * t - 3.1,
        lookahead=np.zeros(n, np.int64) if lookahead is None else lookahead,
        dt_s=1 / rate_hz,
        signals=signals,
    )


@pytest.mark.parametrize("rate_hz", [12.5, 24.0, 25.0, 29.97, 33.0, 59.94])
def test_constant_acceleration_is_carried_exactly(rate_hz):
    raw = driven(rate_hz)
    found = carried(raw)
    t = found.frame * 0.1
    np.testing.assert_array_equal(found.frame, np.arange(len(t)))
    np.testing.assert_allclose(found.position_m[1:, 0], (5 * t + 0.75 * t**2)[1:], atol=1e-9)
    np.testing.assert_allclose(found.velocity_mps[1:, 0], (5 + 1.5 * t)[1:], atol=1e-9)
    turned = np.remainder(found.heading_rad - (0.2 * t - 3.1) + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(turned[1:], 0, atol=1e-9)
    assert (found.lookahead == 0).all()
    assert found.dropped["other_rate"] + len(t) == len(raw.frame)


def test_frames_on_the_grid_are_the_sources_own():
    raw = driven(25.0)
    found = carried(raw)
    np.testing.assert_allclose(found.position_m[::2], raw.position_m[::5], atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(rate_hz=st.sampled_from([25.0, 29.97, 30.0, 12.5]), cut=st.integers(3, 190), first=st.integers(0, 9))
def test_no_frame_knows_what_comes_later(rate_hz, cut, first):
    whole, part = driven(rate_hz, first=first), driven(rate_hz, first=first, n=cut)
    one, other = on_clock(whole), on_clock(part)
    n = len(other.frame)
    for name in ("frame", "position_m", "velocity_mps", "heading_rad"):
        np.testing.assert_array_equal(getattr(one, name)[:n], getattr(other, name))


def test_rows_that_wait_for_a_detection_stay_hidden_until_it():
    ahead = np.zeros(50, np.int64)
    ahead[10:15] = [5, 4, 3, 2, 1]  # detected again at frame 15, 0.6 s
    ahead[40:] = NEVER
    found = carried(driven(25.0, n=50, lookahead=ahead))
    assert found.lookahead[4:7].tolist() == [2, 1, 0]
    assert (found.lookahead[16:] == NEVER).all()


def test_clocks():
    assert on_clock(driven(10.0)).dt_s == 0.1
    assert on_clock(driven(20.0)).frame.tolist() == list(range(100))
    assert on_clock(driven(2.0)).dt_s == 0.5
    log = SignalLog(np.array([0.0, 20.02]), ("1",), np.array([[4, 2]], np.int8), stale_s=100.0)
    slow = on_clock(driven(9.99, signals=log))
    assert slow.dt_s == 0.1
    np.testing.assert_array_equal(slow.position_m, driven(9.99).position_m)
    assert slow.signals is not None
    assert slow.signals.time_s[1] == pytest.approx(20.0, abs=1e-3)
    with pytest.raises(ValueError, match="not shorter"):
        carried(driven(5.0))
