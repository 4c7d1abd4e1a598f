import collections
import os
import pickle
import pickletools

import numpy as np
import pytest

from stylesim.datasets import safe_pickle
from stylesim.datasets.scenarionet import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import scenarionet_files as scenarionet
from tests.formats.world import LANES, STOP, World


def test_values_are_read_exactly(tmp_path):
    (scene,) = scenes(scenarionet.write(tmp_path, scenarionet.document()))
    tracks, world = scene.tracks, World()
    assert tracks.agent_id == tuple(str(i) for i in world.id)
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    there = world.valid
    np.testing.assert_array_equal(tracks.valid, there)
    np.testing.assert_allclose((tracks.position_m + tracks.origin_m)[there], world.position[there], atol=1e-4)
    np.testing.assert_allclose(tracks.velocity_mps[there], world.velocity[there], atol=1e-5)
    np.testing.assert_allclose(tracks.size_m, world.size, atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert tracks.flagged(TrackFlag.FOCAL).tolist() == [False, True] + [False] * 5
    assert (scene.t0_frame, scene.unit_id, scene.source_scenario_id) == (10, "waymo_abc", "abc")
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == world.steps
    lane = scene.road.lane("21")
    np.testing.assert_allclose(lane.centre_line_m + tracks.origin_m, LANES["21"], atol=1e-4)
    assert (lane.successors, lane.left_neighbour, lane.width_m) == (("22",), "23", pytest.approx(3.5, abs=1e-3))
    assert lane.speed_limit_mps == pytest.approx(13.4112)
    np.testing.assert_allclose(lane.stop_line_m.mean(axis=0) + tracks.origin_m, STOP, atol=1e-3)
    assert scene.signals.lane_id == (("21",),)
    assert scene.signals.state[0].tolist() == [SignalState.RED] * 40 + [SignalState.GREEN] * 51


def test_every_generation_of_light_states(tmp_path):
    expected = [SignalState.RED] * 40 + [SignalState.GREEN] * 51
    for n, (red, green) in enumerate([(4, 6), (1, 3), ("TRAFFIC_LIGHT_RED", "TRAFFIC_LIGHT_GREEN"), (4.0, 6.0)]):
        document = scenarionet.document()
        document["dynamic_map_states"]["21"]["state"]["object_state"] = [red] * 40 + [green] * 51
        (scene,) = scenes(scenarionet.write(tmp_path / str(n), document))
        assert scene.signals.state[0].tolist() == expected
    document["dynamic_map_states"]["21"]["state"]["object_state"] = np.array([4] * 40 + [6] * 51)
    (scene,) = scenes(scenarionet.write(tmp_path / "array", document))
    assert scene.signals.state[0].tolist() == expected


def test_the_old_forms_are_refused_with_a_reason(tmp_path):
    document = scenarionet.document()
    for track in document["tracks"].values():
        track["state"] = np.zeros((91, 10))
    with pytest.raises(InputError, match="old form, in which a track's state is one array"):
        list(scenes(scenarionet.write(tmp_path, document)))
    document = scenarionet.document()
    document["dynamic_map_states"]["21"]["state"] = ["LANE_STATE_STOP"] * 91
    with pytest.raises(InputError, match="lights of the old form"):
        list(scenes(scenarionet.write(tmp_path, document)))


def nuscenes(n_frames=91):
    """Interpolated between key frames, velocities towards the next frame, as ScenarioNet makes it of nuScenes."""
    document = scenarionet.document(n_frames=n_frames, dataset="nuscenes")
    document["metadata"] |= {"map": "boston-seaport", "date": "2018-08-28"}
    del document["metadata"]["current_time_index"]
    keys = np.arange(0, n_frames, 5)
    for name, track in document["tracks"].items():
        if name == "11":
            continue
        state = track["state"]
        first = int(np.flatnonzero(state["valid"])[0])
        for column in range(2):
            state["position"][first:, column] = np.interp(
                np.arange(first, n_frames), keys[keys >= first], state["position"][keys[keys >= first], column]
            )
        state["velocity"][:-1] = np.diff(state["position"][:, :2], axis=0) / 0.1
        state["velocity"][-1] = state["velocity"][-2]
    return document


def test_nuscenes_says_what_was_interpolated_and_knows_no_later_frame(tmp_path):
    (scene,) = scenes(scenarionet.write(tmp_path / "a", nuscenes()))
    assert scene.unit_id == "nuscenes_boston-seaport_2018-08-28"
    ahead = scene.tracks.lookahead_steps
    assert ahead[0].tolist() == [1] + [0] * 90  # the ego pose is measured; only its first velocity looks ahead
    assert ahead[1, 10:16].tolist() == [0, 4, 3, 2, 1, 0]
    speed = scene.tracks.speed_mps[1]
    np.testing.assert_allclose(speed[10:86], 9.0 - 0.05 * np.arange(10, 86), atol=0.02)  # not half a second late
    later = nuscenes()
    for track in later["tracks"].values():
        track["state"]["position"][41:] += [3.0, 0, 0]
    (other,) = scenes(scenarionet.write(tmp_path / "b", later))
    one, two = scene.history(40, 30).tracks, other.history(40, 30).tracks
    for name in ("position_m", "velocity_mps", "valid", "size_m"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.valid[1].sum() == 30
    assert np.isnan(scene.road.lane("21").speed_limit_mps)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["metadata"].update(ts=np.arange(91) * 1.0), "apart, not 0.1 s"),
        (lambda d: d["tracks"]["12"]["state"].update(position=np.zeros((50, 3))), "where 91 frames are needed"),
        (lambda d: d["tracks"]["12"]["state"].pop("heading"), "KeyError"),
        (lambda d: d.pop("metadata"), "KeyError"),
        (lambda d: d["dynamic_map_states"]["21"]["state"]["object_state"].pop(), "90 states for 91 frames"),
        (lambda d: d["map_features"]["21"].update(polyline=np.full((3, 2), np.nan)), "not finite"),
    ],
)
def test_what_is_damaged_is_named(tmp_path, change, message):
    document = scenarionet.document()
    change(document)
    file = scenarionet.write(tmp_path, document)
    with pytest.raises(InputError, match=message) as error:
        list(scenes(file))
    assert str(file) in str(error.value)


class _Evil:
    def __init__(self, function, *arguments):
        self.made = function, arguments

    def __reduce__(self):
        return self.made


@pytest.mark.parametrize(
    "evil",
    [
        _Evil(os.system, "touch {proof}"),
        _Evil(eval, "open('{proof}', 'w')"),
        _Evil(getattr, "x", "upper"),
        _Evil(np.load, "{proof}"),
        _Evil(collections.Counter, "abc"),
    ],
)
def test_no_code_is_run(tmp_path, evil):
    proof = tmp_path / "proof"
    evil.made = evil.made[0], tuple(a.replace("{proof}", str(proof)) for a in evil.made[1])
    document = scenarionet.document()
    document["metadata"]["extra"] = evil
    file = scenarionet.write(tmp_path / "in", document)
    with pytest.raises(InputError, match="which data do not need; it was not run"):
        list(scenes(file))
    assert not proof.exists()


@pytest.mark.parametrize(
    "raw",
    [
        b"\x80\x04\x8c\x01ar\xff\xff\xff\x7f.",  # memo entry 2,147,483,647
        b"\x80\x04" + b"]" * 200_000 + b"a" * 199_999 + b".",  # nested 200,000 deep
        b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\x7f",  # 9 EB of bytes
        b"\x80\x04\x82\x01.",  # extension registry
        b"\x80\x04Pabc\n.",  # persistent id
    ],
)
def test_pickles_that_would_eat_memory_are_refused(raw):
    with pytest.raises((ValueError, pickle.UnpicklingError, EOFError)):
        safe_pickle.loads(raw)


def test_arrays_of_all_kinds_survive():
    arrays = {
        "f8": np.arange(6.0).reshape(2, 3), "f4": np.float32([1, 2]),
        "fortran": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "big": np.arange(3, dtype=">i4"), "bool": np.array([True, False]), "text": np.array(["ab", "c"]),
        "empty": np.zeros((0, 3)), "scalar": np.float64(2.5), "int": np.int64(7), "zero": np.array(3.0),
    }  # fmt: skip
    for protocol in (2, 3, 4, 5):
        back = safe_pickle.loads(pickle.dumps(arrays, protocol))
        for name, value in arrays.items():
            np.testing.assert_array_equal(back[name], value)
    mixed = safe_pickle.loads(pickle.dumps({"o": np.array([1, "a", None], object), "d": collections.OrderedDict(a=1)}))
    assert mixed == {"o": [1, "a", None], "d": {"a": 1}}
    shared = [1]
    again = safe_pickle.loads(pickle.dumps([shared, shared, {"k": shared}]))
    assert again == [[1], [1], {"k": [1]}]
    assert sum(1 for _ in pickletools.genops(pickle.dumps(arrays))) > 20


def test_real_scenarios(shared_data):
    folder = shared_data / "scenarionet"
    if not folder.is_dir():
        pytest.skip(f"no ScenarioNet database at {folder}")
    found = {s.source_scenario_id: s for s in scenes(folder)}
    assert {k: s.tracks.valid.shape for k, s in found.items()} == {
        "scene-0061": (211, 191), "scene-0103": (114, 196), "scene-0553": (57, 201), "2a1e44d405a6833f": (211, 91),
    }  # fmt: skip
    for scene in found.values():
        lost = sum(n for key, n in scene.counts.items() if key.startswith("rows_dropped_"))
        assert scene.counts["rows_in"] == scene.counts["rows_out"] + lost
        assert lost < 0.002 * scene.counts["rows_in"]
        assert scene.tracks.flagged(TrackFlag.IMPLAUSIBLE).mean() < 0.02
        assert scene.tracks.flagged(TrackFlag.EGO).sum() == 1
    waymo = found["2a1e44d405a6833f"]
    assert len(waymo.signals.signal_id) == 8
    assert waymo.tracks.lookahead_steps is None
    assert found["scene-0061"].tracks.lookahead_steps.max() > 0


def test_a_string_with_an_escape_that_no_pickle_has_is_refused_and_not_warned_of():
    with pytest.raises(safe_pickle.UnsafePickleError, match="damaged: invalid escape"):
        safe_pickle.loads(b"S'a\\qb'\n.")
    assert safe_pickle.loads(b"S'a\\nb'\n.") == "a\nb"
