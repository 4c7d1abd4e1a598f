import numpy as np
import pytest

from stylesim.datasets.sind import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind
from tests.formats import sind_files as sind
from tests.formats.traffic import rows


def test_values_lights_and_their_lanes(tmp_path):
    (scene,) = scenes(sind.sample(tmp_path))
    tracks = scene.tracks
    assert tracks.dt_s == 0.1
    assert tracks.agent_id == ("1", "2", "3", "4", "5", "6", "P7")
    assert tracks.kind.tolist()[5:] == [AgentKind.TRUCK, AgentKind.PEDESTRIAN]
    own = [r for r in rows(dt_s=sind.STEP_MS / 1000) if r.agent == 2]
    np.testing.assert_allclose(tracks.position_m[1] + tracks.origin_m, [(r.x, r.y) for r in own], atol=1e-4)
    assert scene.counts["rows_dropped_unreadable"] == 1
    signals = scene.signals
    assert signals.signal_id == ("Traffic light 1", "Traffic light 2")
    assert signals.lane_id == ((), ("1001", "1002"))  # the map names only one of them
    assert [SignalState(signals.state[1, k]).name for k in (0, 49, 50, 79, 81)] == [
        "GREEN", "GREEN", "YELLOW", "YELLOW", "RED",
    ]  # fmt: skip
    assert (signals.state[0, :79] == SignalState.RED).all()


def test_links_are_the_maps_inferred_or_none(tmp_path):
    path = sind.sample(tmp_path)
    assert next(iter(scenes(path, links="none"))).signals.lane_id == ((), ())
    assert next(iter(scenes(path, links="infer"))).signals.lane_id == ((), ("1001", "1002"))
    assert next(iter(scenes(path, map="none"))).road is None
    with pytest.raises(InputError, match="Did you mean 'infer'"):
        list(scenes(path, links="inferred"))


def test_the_meta_data_alone_are_no_recording(shared_data):
    folder = shared_data / "sind"
    if not folder.is_dir():
        pytest.skip(f"no meta data of SinD at {folder}")
    with pytest.raises(InputError, match="the tables of meta data alone are no recording"):
        list(scenes(folder))


def test_the_real_map_and_light_log_with_made_tracks(shared_data, tmp_path):
    """Vehicle tracks are not public: ours, with the recorded map and the recorded changes of the lights."""
    folder = shared_data / "sind"
    if not folder.is_dir():
        pytest.skip(f"no map of SinD at {folder}")
    recording = sind.write(tmp_path / "8_2_1")
    (recording / "TrafficLight_8_2_1.csv").write_bytes((folder / "8_2_1" / "TrafficLight_8_2_1.csv").read_bytes())
    (scene,) = scenes(tmp_path, map=str(folder / "map_relink_law_save.osm"))
    assert len(scene.road.lanes) == 62
    linked = {i: lanes for i, lanes in zip(scene.signals.signal_id, scene.signals.lane_id, strict=True) if lanes}
    assert sorted(linked) == [f"Traffic light {k}" for k in (2, 4, 6, 8)]
    state = dict(zip(scene.signals.signal_id, scene.signals.state, strict=True))
    assert (state["Traffic light 1"][:96] == SignalState.GREEN).all()  # until 9.676 s, then yellow
    assert state["Traffic light 1"][98] == SignalState.YELLOW
    assert (state["Traffic light 2"] == SignalState.RED).all()
