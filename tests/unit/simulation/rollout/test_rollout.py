"""A recording that goes on with styled drivers: the log until then, lanes, leaders, lights and crossings after."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from stylesim.cli.main import main
from stylesim.corpus import Corpus, CorpusWriter
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.road import Lane, Road
from stylesim.scene import Scene
from stylesim.signals import Signals, SignalState
from stylesim.simulation.rollout import generate_from
from stylesim.simulation.rollout.path import Path
from stylesim.simulation.rollout.route import Lanes
from stylesim.simulation.rollout.scene import continued
from stylesim.tracks import AgentKind, TrackFlag, Tracks

CROWD = Population.load("tdbm_spectrum")
FRAMES, DT, AT_S = 150, 0.1, 3.0
MOMENT = 30


def straight(x_m, y_m, speed_mps, heading_rad=0.0):
    """Positions over all frames of somebody who goes straight on."""
    time = np.arange(FRAMES) * DT
    way = np.stack([np.cos(heading_rad) * speed_mps * time, np.sin(heading_rad) * speed_mps * time], axis=1)
    return np.array([x_m, y_m]) + way


def recording(paths, *, road, headings=None, kinds=None, signals=None, valid=None):
    """A scene of those paths."""
    position = np.array(paths)
    n = len(paths)
    velocity = np.gradient(position, DT, axis=1)
    heading = np.zeros((n, FRAMES)) if headings is None else np.repeat(np.array(headings)[:, None], FRAMES, axis=1)
    tracks = Tracks(
        agent_id=tuple(f"a{i}" for i in range(n)),
        kind=np.array(kinds or [AgentKind.CAR] * n),
        size_m=np.tile([4.5, 1.8], (n, 1)),
        position_m=position,
        velocity_mps=velocity,
        heading_rad=heading,
        valid=np.ones((n, FRAMES), bool) if valid is None else valid,
        dt_s=DT,
    )
    return Scene("rec-0", "rec", "made", "site", tracks, road=road, signals=signals)


def lane(name, points, **options):
    return Lane(name, np.array(points, float), width_m=3.5, speed_limit_mps=13.9, **options)


STRAIGHT = Road((lane("in", [[0, 0], [100, 0]], successors=("out",)), lane("out", [[100, 0], [400, 0]])))


def drive(scene, *, drivers=None, population=CROWD, episode=0):
    lanes = Lanes(scene.road)
    return continued(scene, lanes, population, at_s=AT_S, drivers=drivers, seed=2, episode=episode)


def test_until_the_moment_it_is_the_log_and_others_stay_with_it():
    scene = recording([straight(10, 0.4, 10), straight(60, 0, 12)], road=STRAIGHT)
    found = drive(scene, drivers=frozenset({"a0"}))
    for name in ("position_m", "velocity_mps", "heading_rad", "valid"):
        np.testing.assert_array_equal(
            getattr(found.tracks, name)[:, : MOMENT + 1], getattr(scene.tracks, name)[:, : MOMENT + 1]
        )
    np.testing.assert_array_equal(found.tracks.position_m[1], scene.tracks.position_m[1])
    assert not np.allclose(found.tracks.position_m[0, -1], scene.tracks.position_m[0, -1], atol=0.5)
    assert found.tracks.driver[1] is None
    assert found.tracks.driver[0] is not None
    assert (found.replay_of, found.unit_id, found.source) == ("rec-0", "rec", "rollout")
    assert found.metadata["from_recording"]["drivers"] == ["a0"]
    assert found.counts["handed_over"] == 1


def test_it_goes_on_smoothly_and_keeps_to_human_limits():
    scene = recording([straight(10, 0.8, 10), straight(60, 0, 6)], road=STRAIGHT)
    for episode in range(6):
        tracks = drive(scene, drivers=frozenset({"a0"}), episode=episode).tracks
        acceleration = np.diff(tracks.speed_mps[0], n=1) / DT
        jerk = np.diff(acceleration) / DT
        assert np.nanmin(acceleration) > -8.1
        assert np.nanmax(acceleration) < 4.5
        assert np.nanquantile(np.abs(jerk[MOMENT - 1 :]), 0.99) < 15.0
        step = np.linalg.norm(np.diff(tracks.position_m[0].astype(float), axis=0), axis=1)
        np.testing.assert_allclose(step[MOMENT:], tracks.speed_mps[0, MOMENT + 1 :] * DT, atol=0.05)


def test_a_driver_follows_its_lanes_around_a_bend():
    angle = np.linspace(-np.pi / 2, 0, 16)
    bend = np.stack([100 + 20 * np.cos(angle), 20 + 20 * np.sin(angle)], axis=1)
    road = Road(
        (
            lane("in", [[0, 0], [100, 0]], successors=("bend", "on")),
            lane("bend", bend, successors=("up",)),
            lane("on", [[100, 0], [300, 0]]),
            lane("up", [[120, 20], [120, 220]]),
        )
    )
    went = np.concatenate([straight(20, 0, 9)[:90], np.zeros((60, 2))])
    went[90:, 0] = 118.0
    went[90:, 1] = 25 + 0.9 * np.arange(60)  # the driver has turned left
    found = drive(recording([went], road=road), population=Population.of(careful=1.0)).tracks
    x, y = found.position_m[0, -1]
    assert abs(x - 120) < 1.5
    assert y > 20
    sideways = found.speed_mps[0] * np.gradient(np.unwrap(found.heading_rad[0].astype(float)), DT)
    inside = (found.position_m[0, :, 0] > 102) & (found.position_m[0, :, 1] < 18)
    assert sideways[inside].max() < 4.0


def test_nobody_runs_into_a_standing_leader():
    scene = recording([straight(10, 0, 12), straight(150, 0, 0)], road=STRAIGHT)
    for episode in range(6):
        found = drive(scene, drivers=frozenset({"a0"}), episode=episode)
        assert found.counts["collisions"] == 0
        assert 130.0 < found.tracks.position_m[0, -1, 0] < 147.0
        assert found.tracks.speed_mps[0, -1] < 4.0


def lights(states):
    """One light on the first lane."""
    return Signals(("light",), (("in",),), np.array([states]))


def test_a_recorded_light_is_obeyed_by_style():
    state = np.full(FRAMES, SignalState.GREEN)
    state[36:70], state[70:] = SignalState.YELLOW, SignalState.RED
    scene = recording([straight(10, 0, 13.9)], road=STRAIGHT, signals=lights(state))
    crossed, agreed = {"timid": 0, "aggressive": 0}, 0
    for style in crossed:
        for episode in range(12):
            found = drive(scene, population=Population.of(**{style: 1.0}), episode=episode)
            flags = TrackFlag(int(found.tracks.flags[0]))
            beyond = bool(found.tracks.position_m[0, -1, 0] + 2.25 > 100.6)
            crossed[style] += beyond
            agreed += beyond == (TrackFlag.DECIDED_GO in flags)
            assert (TrackFlag.DECIDED_GO in flags) != (TrackFlag.DECIDED_STOP in flags)
    assert agreed >= 22  # of 24: what was decided is what was done
    assert crossed["aggressive"] >= crossed["timid"] + 4


def test_who_crosses_by_its_log_is_given_way():
    cross = straight(100, -60, 8, np.pi / 2)  # over the road at 7.5 s
    scene = recording([straight(10, 0, 12), cross], road=STRAIGHT, headings=[0.0, np.pi / 2])
    hits = [drive(scene, drivers=frozenset({"a0"}), episode=episode).counts["collisions"] for episode in range(8)]
    assert sum(hits) == 0


def test_who_comes_later_is_handed_over_then_and_who_has_no_lane_is_counted():
    valid = np.ones((3, FRAMES), bool)
    valid[1, :60] = False
    paths = [straight(60, 0, 10), straight(-20, 0, 10), straight(30, 30, 5)]
    paths = [np.where(valid[i][:, None], path, np.nan) for i, path in enumerate(paths)]
    scene = recording(paths, road=STRAIGHT, valid=valid)
    found = drive(scene)
    assert dict(found.counts) | {"collisions": 0} == {
        "handed_over": 2, "without_a_lane": 1, "left_the_map": 0, "lights_without_lanes": 0, "collisions": 0,
    }  # fmt: skip
    np.testing.assert_array_equal(found.tracks.position_m[1, :61], scene.tracks.position_m[1, :61])
    assert found.tracks.driver[1] is not None
    np.testing.assert_array_equal(found.tracks.position_m[2], scene.tracks.position_m[2])


def test_pedestrians_stay_with_their_log():
    scene = recording([straight(10, 0, 10), straight(50, 5, 1)], road=STRAIGHT, kinds=[1, 6])
    assert drive(scene).tracks.driver[1] is None
    with pytest.raises(InputError, match=r"'a1'.*no motor vehicle"):
        drive(scene, drivers=frozenset({"a1"}))
    with pytest.raises(InputError, match="'zz' is not in scene"):
        drive(scene, drivers=frozenset({"zz"}))


def test_paths_join_lanes_that_overlap():
    path = Path.along([("a", np.array([[0.0, 0], [50, 0]])), ("b", np.array([[44.0, 0], [90, 0]]))])
    assert path.length_m == pytest.approx(90.0, abs=0.1)
    np.testing.assert_allclose(path.point_m[:, 1], 0.0, atol=1e-9)
    along, left = path.project(np.array([[60.0, 1.5], [-3.0, 0.0]]))
    assert along == pytest.approx([60.0, -3.0], abs=0.05)
    assert left == pytest.approx([1.5, 0.0], abs=1e-6)


@pytest.fixture
def recorded(tmp_path):
    scene = recording([straight(10, 0, 10), straight(60, 0, 12)], road=STRAIGHT)
    with CorpusWriter(tmp_path / "recorded", source="made", configuration={}) as writer:
        writer.add(scene)
        writer.add(replace(scene, scene_id="rec-1"))
        writer.add(replace(scene, scene_id="rec-2", road=None))
        return writer.finish()


def test_a_corpus_goes_on_with_the_same_bytes(recorded, tmp_path):
    request = {"at_s": AT_S, "scenes": ["rec-0", "rec-1"], "episodes": 2, "seed": 5}
    one = generate_from(recorded, "tdbm_spectrum", out=tmp_path / "one", **request)
    two = generate_from(recorded, "tdbm_spectrum", out=tmp_path / "two", **request)
    assert one.fingerprint == two.fingerprint
    assert [(info.scene_id, info.replay_of) for info in one.info] == [
        (f"rec-{n}-from3s-5-{episode:05d}", f"rec-{n}") for n in (0, 1) for episode in (0, 1)
    ]
    assert one.manifest["configuration"]["from"] == recorded.fingerprint
    positions = [scene.tracks.position_m[0, -1, 0] for scene in one]
    assert len({round(float(x), 3) for x in positions[:2]}) == 2  # another episode, other people


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"scenes": ["rec-9"]}, "did you mean"),
        ({"scenes": ["rec-2"]}, "no road"),
        ({"scenes": ["rec-0"], "at_s": 15.0}, "lasts 15 s"),
        ({"scenes": ["rec-0"], "episodes": 0}, "episodes must be"),
    ],
)
def test_what_cannot_go_on_is_refused_before_any_work(recorded, tmp_path, options, says):
    with pytest.raises(InputError, match=says):
        generate_from(recorded, CROWD, out=tmp_path / "out", **{"at_s": AT_S, **options})
    assert not list(tmp_path.glob("out*"))


def test_the_command_line(recorded, tmp_path, capsys):
    base = ["generate", "--from", str(recorded.path), "--out", str(tmp_path / "out")]
    main_or_exit([*base, "--scene", "rec-0", "--at", "3", "--episodes", "1", "--drivers", "a0"])
    made = Corpus(tmp_path / "out")
    assert made.info[0].metadata["from_recording"]["drivers"] == ["a0"]
    assert json.loads((tmp_path / "out" / "corpus.json").read_text())["source"] == "rollout"
    for more, says in (
        ([], "say when"),
        (["--at", "3", "--stressor", "deer"], "cannot go with --stressor"),
        (["yellow_light", "--at", "3"], "cannot go with a scenario"),
    ):
        with pytest.raises(SystemExit):
            main([*base[:3], "--out", str(tmp_path / "other"), *more])
        assert says in capsys.readouterr().err.replace("\n", " ")


def main_or_exit(argv):
    with pytest.raises(SystemExit) as done:
        main(argv)
    assert not done.value.code
