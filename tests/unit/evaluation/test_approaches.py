"""What drivers did at a yellow, from tracks whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from stylesim.evaluation.approaches import yellow_approaches
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals
from stylesim.styles import style_table
from stylesim.tracks import AgentKind, TrackFlag, Tracks

FRAMES, DT_S, ONSET, RED, GREEN = 300, 0.1, 50, 90, 250
LINE_M = 200.0


def drive(start_m: float, speed: float, *, brake_at: int | None = None, braking: float = 3.0) -> np.ndarray:
    """Positions of the centre; constant speed, then even braking to a stand, then on with the green."""
    x, v, out = start_m, speed, []
    for frame in range(FRAMES):
        if brake_at is not None and frame >= brake_at:
            v = max(0.0, v - braking * DT_S) if frame < GREEN else speed
        x += v * DT_S
        out.append(x)
    return np.array(out)


def scene(paths: list[np.ndarray], lanes: list[float], flags: list[TrackFlag]) -> Scene:
    n = len(paths)
    x = np.array(paths)
    position = np.stack([x, np.repeat(np.array(lanes)[:, None], FRAMES, axis=1)], axis=-1)
    velocity = np.zeros_like(position)
    velocity[:, 1:, 0] = np.diff(x, axis=1) / DT_S
    velocity[:, 0] = velocity[:, 1]
    tracks = Tracks(
        agent_id=tuple(f"car{i}" for i in range(n)),
        kind=np.full(n, AgentKind.CAR),
        size_m=np.tile([4.0, 1.8], (n, 1)),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=np.zeros((n, FRAMES)),
        valid=np.ones((n, FRAMES), bool),
        dt_s=DT_S,
        driver=tuple(style_table().at(-0.2) for _ in range(n)),
        flags=np.array(flags, np.int32),
    )
    made = []
    for y in sorted(set(lanes)):
        line = np.array([[0.0, y], [LINE_M, y]])
        stop = np.array([[LINE_M, y - 1.7], [LINE_M, y + 1.7]])
        made.append(Lane(f"lane{y:g}", line, width_m=3.5, stop_line_m=stop))
    state = np.full((1, FRAMES), 2)
    state[:, ONSET:RED], state[:, RED:GREEN] = 3, 4
    signals = Signals(("light",), (tuple(lane.lane_id for lane in made),), state)
    return Scene("made", "unit", "made", "straight", tracks, Road(tuple(made)), signals)


def test_stopping_crossing_and_running_red_are_read_from_the_track() -> None:
    stops = drive(LINE_M - 2.0 - 60.0 - 15.0 * (ONSET + 1) * DT_S, 15.0, brake_at=ONSET + 10, braking=2.6)
    crosses = drive(LINE_M - 2.0 - 30.0 - 15.0 * (ONSET + 1) * DT_S, 15.0)
    runs = drive(LINE_M - 2.0 - 75.0 - 15.0 * (ONSET + 1) * DT_S, 15.0)
    found = yellow_approaches(
        [
            scene(
                [stops, crosses, runs],
                [0.0, 4.0, 8.0],
                [TrackFlag.DECIDED_STOP, TrackFlag.DECIDED_GO, TrackFlag.DECIDED_STOP],
            )
        ]
    )
    np.testing.assert_allclose(found.tts_s, [4.0, 2.0, 5.0], atol=1e-3)
    assert found.stopped.tolist() == [True, False, False]
    assert found.ran_red.tolist() == [False, False, True]
    assert found.decided.tolist() == [1, 0, 1]  # the third decided otherwise than it did
    assert found.free.all()
    assert found.response_s[0] == pytest.approx(1.0, abs=0.25)
    assert found.deceleration_mps2[0] == pytest.approx(2.6, rel=0.05)
    assert np.isnan(found.deceleration_mps2[1:]).all()
    assert found.counts == {"at the onset of yellow": 3}


def test_a_car_ahead_on_the_lane_is_no_free_approach() -> None:
    one = drive(LINE_M - 2.0 - 60.0 - 15.0 * (ONSET + 1) * DT_S, 15.0, brake_at=ONSET + 5)
    behind = one - 20.0
    found = yellow_approaches([scene([one, behind], [0.0, 0.0], [TrackFlag.DECIDED_STOP] * 2)])
    assert found.free.tolist() == [True, False]
    assert len(found.where(found.free)) == 1


def test_who_does_neither_is_counted() -> None:
    crawls = drive(100.0, 0.5)
    between = drive(LINE_M - 2.0 - 60.0 - 7.0 * (ONSET + 1) * DT_S, 7.0, brake_at=ONSET, braking=0.1)
    found = yellow_approaches([scene([crawls, between], [0.0, 4.0], [TrackFlag.DECIDED_GO] * 2)])
    assert sum(found.counts.values()) >= 1
    assert len(found) + sum(found.counts.values()) - found.counts.get("at the onset of yellow", 0) == found.counts.get(
        "at the onset of yellow", 0
    )
