import json

import numpy as np
import pytest

from stylesim.datasets.gpudrive import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind, TrackFlag
from tests.formats import gpudrive_files as gpudrive
from tests.formats.world import LANES, World


def test_values_are_read_exactly(tmp_path):
    (scene,) = scenes(gpudrive.write(tmp_path, gpudrive.document()))
    tracks, world = scene.tracks, World()
    assert tracks.agent_id == tuple(str(i) for i in world.id)
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.BICYCLE, AgentKind.PEDESTRIAN]
    np.testing.assert_array_equal(tracks.valid, world.valid)
    there = world.valid
    np.testing.assert_allclose((tracks.position_m + tracks.origin_m)[there], world.position[there], atol=1e-4)
    np.testing.assert_allclose(tracks.velocity_mps[there], world.velocity[there], atol=1e-5)
    np.testing.assert_allclose(tracks.size_m, world.size, atol=1e-6)
    assert tracks.flagged(TrackFlag.EGO).tolist() == [True] + [False] * 6
    assert tracks.flagged(TrackFlag.FOCAL).tolist() == [False, True] + [False] * 5
    assert [lane.successors for lane in scene.road.lanes] == [("22",), (), ("24",), ()]
    np.testing.assert_allclose(scene.road.lane("21").centre_line_m + tracks.origin_m, LANES["21"], atol=1e-4)
    assert scene.signals.state[0].tolist() == [SignalState.RED] * 40 + [SignalState.GREEN] * 51
    assert (scene.t0_frame, scene.unit_id) == (10, "womd_abc")
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == world.steps


def test_degrees_of_nocturne(tmp_path):
    document = gpudrive.document()
    for thing in document["objects"]:
        thing["heading"] = np.degrees(thing["heading"]).tolist()
    (scene,) = scenes(gpudrive.write(tmp_path, document))
    there = scene.tracks.valid
    np.testing.assert_allclose(scene.tracks.heading_rad[there], World().heading[there], atol=1e-6)


def test_old_files_have_no_metadata(tmp_path):
    document = gpudrive.document()
    del document["metadata"], document["scenario_id"]
    document["tl_states"] = {}
    (scene,) = scenes(gpudrive.write(tmp_path, document))
    assert scene.signals is None
    assert not scene.tracks.flagged(TrackFlag.EGO).any()
    assert scene.source_scenario_id == "abc.json"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("objects"), "KeyError"),
        (lambda d: d["objects"][0]["valid"].pop(), "damaged"),
        (lambda d: d["objects"][0].update(id=12), "two objects have one id"),
        (lambda d: d["tl_states"]["21"]["state"].__setitem__(3, "purple"), "no state of a traffic light"),
        (lambda d: d["metadata"]["tracks_to_predict"][0].update(track_index=99), "is not there"),
        (lambda d: d["roads"][0]["geometry"][0].update(x=float("nan")), "not finite"),
    ],
)
def test_what_is_damaged_is_named(tmp_path, change, message):
    document = gpudrive.document()
    change(document)
    file = gpudrive.write(tmp_path, document)
    with pytest.raises(InputError, match=message) as error:
        list(scenes(file))
    assert str(file) in str(error.value)


@pytest.mark.parametrize("content", ["", "{", "[1, 2]", '{"objects": []}', "[" * 100_000])
def test_what_is_no_scenario_is_named(tmp_path, content):
    (tmp_path / "x.json").write_text(content)
    with pytest.raises(InputError, match=r"x\.json is damaged or no scenario"):
        list(scenes(tmp_path))


def test_real_scenarios(shared_data):
    folder = shared_data / "womd" / "json"
    if not folder.is_dir():
        pytest.skip(f"no GPUDrive JSON at {folder}")
    found = list(scenes(folder))
    assert [s.tracks.valid.shape for s in found] == [(62, 91), (15, 91)]
    for scene, file in zip(found, sorted(folder.glob("*.json")), strict=True):
        objects = json.loads(file.read_text())["objects"]
        assert scene.counts["rows_in"] == scene.counts["rows_out"] == sum(sum(o["valid"]) for o in objects)
        assert not scene.tracks.flagged(TrackFlag.IMPLAUSIBLE).any()
