import io

import numpy as np
import pytest

from stylesim.envs.config import EnvConfig
from stylesim.envs.wire import (
    Kind,
    packed_commands,
    packed_episode,
    packed_picture,
    packed_snapshot,
    packed_snapshots,
    receive,
    send,
    unpacked_commands,
    unpacked_episode,
    unpacked_picture,
    unpacked_snapshot,
    unpacked_snapshots,
)
from stylesim.envs.world import LEAVES, EgoCommand, Picture
from stylesim.population import Population
from stylesim.road import Lane, Road
from stylesim.scenario import load_scenario
from tests.unit.envs.snapshots import made_snapshot


def test_a_snapshot_survives_the_wire_bit_for_bit() -> None:
    sent = made_snapshot([(1.0, 2.0, 3.0, 4.0, 0.5), (1e-300, -0.0, 3.0, 4.0, 0.5)], stop_line_m=np.inf)
    got = unpacked_snapshot(packed_snapshot(sent))
    assert got.ego == sent.ego
    for name in ("number", "pose", "style", "knob", "decision", "ran_red", "crashed", "lights"):
        assert getattr(got, name).dtype == getattr(sent, name).dtype
        assert getattr(got, name).tobytes() == getattr(sent, name).tobytes()


def test_several_snapshots_keep_their_order_and_their_lengths() -> None:
    sent = [made_snapshot([(float(i), 2.0, 3.0, 4.0, 0.5)] * i) for i in range(3)]
    got = unpacked_snapshots(packed_snapshots(sent))
    assert [packed_snapshot(one) for one in got] == [packed_snapshot(one) for one in sent]
    assert unpacked_snapshots(b"") == ()


def test_commands_and_episodes() -> None:
    commands = (EgoCommand(-1.5, 20.0, -1), EgoCommand(0.5, 1.0, LEAVES))
    assert unpacked_commands(packed_commands(commands)) == commands
    crowd = Population.load("rare_heavy")
    config = EnvConfig(duration_s=12.0)
    body = packed_episode(load_scenario("yellow_light"), crowd, 9, config, 3)
    scenario, population, seed, got, egos = unpacked_episode(body)
    assert (scenario, seed, got, egos) == (load_scenario("yellow_light"), 9, config, 3)
    assert (population.name, population.shares) == (crowd.name, crowd.shares)


def test_a_picture() -> None:
    lane = Lane("a", np.array([[0.0, 0.0], [5.0, 1.0]], np.float32), width_m=3.2, in_junction=True)
    got = unpacked_picture(packed_picture(Picture(Road((lane,)), np.ones((1, 2, 2)))))
    assert np.array_equal(got.road.lanes[0].centre_line_m, lane.centre_line_m)
    assert (got.road.lanes[0].width_m, got.road.lanes[0].in_junction) == (3.2, True)
    assert got.stop_lines_m.shape == (1, 2, 2)


def test_framing_and_its_end() -> None:
    stream = io.BytesIO()
    send(stream, Kind.STEP, b"abc")
    send(stream, Kind.PICTURE)
    stream.seek(0)
    assert receive(stream) == (Kind.STEP, b"abc")
    assert receive(stream) == (Kind.PICTURE, b"")
    with pytest.raises(EOFError):
        receive(stream)
    with pytest.raises(EOFError, match="does not speak"):
        receive(io.BytesIO(b"\xff\xff\xff\xffO"))
