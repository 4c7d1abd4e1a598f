import numpy as np
import pytest

from stylesim.datasets.commonroad import scenes
from stylesim.errors import InputError
from stylesim.signals import SignalState
from stylesim.tracks import AgentKind
from tests.formats import commonroad_files as commonroad
from tests.formats.traffic import rows


@pytest.mark.parametrize("version", ["2020a", "2018b"])
def test_values_of_both_versions(tmp_path, version):
    (scene,) = scenes(commonroad.write(tmp_path, version=version))
    tracks = scene.tracks
    assert tracks.n_frames == 60
    assert tracks.agent_id == ("101", "102", "103", "104", "105", "106", "107", "200")
    assert tracks.kind.tolist() == [1, 1, 1, 1, 1, AgentKind.TRUCK, AgentKind.PEDESTRIAN, AgentKind.CAR]
    own = [r for r in rows(n_frames=60) if r.agent == 2]
    np.testing.assert_allclose(tracks.position_m[1] + tracks.origin_m, [(r.x, r.y) for r in own], atol=1e-3)
    np.testing.assert_allclose(tracks.heading_rad[1], [r.heading for r in own], atol=1e-6)
    np.testing.assert_allclose(tracks.speed_mps[1], [np.hypot(r.vx, r.vy) for r in own], atol=1e-5)
    assert tracks.valid[7].all()  # the parked car is there in every frame
    assert tracks.speed_mps[7].max() == 0.0
    assert (scene.unit_id, scene.scenario) == ("commonroad_USA_Test", "USA_Test")


def test_the_road(tmp_path):
    (scene,) = scenes(commonroad.write(tmp_path))
    one, two, three = scene.road.lanes
    np.testing.assert_allclose(one.centre_line_m + scene.tracks.origin_m, [[-120, 0], [-50, 0], [20, 0]], atol=1e-4)
    assert (one.successors, three.successors) == (("3",), ())
    assert (one.left_neighbour, two.right_neighbour) == ("2", "1")
    assert [lane.in_junction for lane in scene.road.lanes] == [False, False, True]
    assert one.speed_limit_mps == pytest.approx(13.4112)
    np.testing.assert_allclose(one.stop_line_m + scene.tracks.origin_m, [[20, 1.75], [20, -1.75]], atol=1e-4)


def test_lights_go_through_their_cycle(tmp_path):
    """red 20, red and yellow 5, green 10, yellow 3 steps; offset 4: step 4 is the first of red."""
    (scene,) = scenes(commonroad.write(tmp_path))
    assert scene.signals.lane_id == (("1",),)
    shown = scene.signals.state[0]
    red, green, yellow = SignalState.RED, SignalState.GREEN, SignalState.YELLOW
    expected = [green] + [yellow] * 3 + [red] * 25 + [green] * 10 + [yellow] * 3 + [red] * 18
    np.testing.assert_array_equal(shown, [int(s) for s in expected])


def test_cuts_of_one_site_are_one_unit_and_come_once(tmp_path):
    commonroad.sample(tmp_path)
    found = list(scenes(tmp_path))
    assert len({s.unit_id for s in found}) == 1
    (tmp_path / "copy").mkdir()
    (tmp_path / "copy" / "again.xml").write_text(commonroad.scenario())
    with pytest.raises(InputError, match="are both the scenario commonroad_USA_Test-1_1_T-1"):
        list(scenes(tmp_path))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('commonRoadVersion="2020a"', 'commonRoadVersion="2017a"', "is of version '2017a'"),
        ('timeStepSize="0.1"', 'timeStepSize="100"', "timeStepSize is '100'"),
        ('timeStepSize="0.1"', 'timeStepSize="0.3"', "positions move 0.33"),
        ("<exact>59</exact>", "<exact>5900000</exact>", "expected 0 to 100000"),
        ("<leftBound>", "<left>", "damaged"),
        ("<?xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><?xml", "damaged|document type"),
    ],
)
def test_damaged_scenarios_are_named(tmp_path, old, new, says):
    path = commonroad.write(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=says) as error:
        list(scenes(path))
    assert str(path) in str(error.value)


def test_real_scenarios(shared_data):
    folder = shared_data / "commonroad"
    if not folder.is_dir():
        pytest.skip(f"no CommonRoad scenarios at {folder}")
    (old,) = scenes(folder / "USA_US101-3_3_T-1.xml")
    assert (old.tracks.n_agents, len(old.road.lanes), old.unit_id) == (12, 12, "commonroad_USA_US101")
    (new,) = scenes(folder / "USA_Lanker-1_10_T-1.xml")
    assert (new.tracks.n_agents, len(new.road.lanes)) == (32, 95)
    assert len(new.signals.signal_id) == 8
    assert all(new.signals.lane_id)
    assert new.road.lane("3419").speed_limit_mps == pytest.approx(13.4112)
    assert sum(lane.stop_line_m is not None for lane in new.road.lanes) > 10


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("</commonRoad>", "<!-- read as a tree --></commonRoad>"),
        lambda text: text.replace("<trajectory>", "<trajectory >"),
        lambda text: text.replace("<velocity><exact>", "<odd/><velocity><exact>"),
        lambda text: text.replace("<state>", "<state>\n  "),
        lambda text: text.replace("<exact>5</exact>", "<exact>5.0</exact>"),
    ],
    ids=["comment", "space", "unknown field", "indented", "a step that is no whole number in the text"],
)
def test_both_ways_of_reading_states_give_the_same(tmp_path, change):
    (one,) = scenes(commonroad.write(tmp_path))
    path = commonroad.write(tmp_path)
    text = path.read_text()
    assert change(text) != text
    path.write_text(change(text))
    (other,) = scenes(path)
    for name in ("position_m", "velocity_mps", "heading_rad", "valid"):
        np.testing.assert_array_equal(getattr(one.tracks, name), getattr(other.tracks, name))
    assert one.tracks.agent_id == other.tracks.agent_id
    assert dict(one.counts) == dict(other.counts)


def test_states_that_are_commented_out_are_not_read(tmp_path):
    path = commonroad.write(tmp_path)
    text = path.read_text()
    start = text.index("<state>")
    end = text.index("</state>") + len("</state>")
    path.write_text(text[:start] + "<!--" + text[start:end] + "-->" + text[end:])
    (scene,) = scenes(path)
    assert scene.tracks.valid[0].sum() == 59


def test_what_commonroad_io_reads(shared_data):
    """commonroad-io 2026.1 on USA_Lanker-1_10_T-1: a state, a centre line, and lights at chosen steps."""
    file = shared_data / "commonroad" / "USA_Lanker-1_10_T-1.xml"
    if not file.is_file():
        pytest.skip(f"no scenario at {file}")
    (scene,) = scenes(file)
    lane = scene.road.lane("3419")
    np.testing.assert_allclose(
        lane.centre_line_m[:3] + scene.tracks.origin_m,
        [[29.302717, 54.391478], [24.8959, 45.41495], [21.46495, 38.426]],
        atol=1e-4,
    )
    agent = scene.tracks.agent_id.index("1881")
    np.testing.assert_allclose(
        scene.tracks.position_m[agent, 6] + scene.tracks.origin_m, [-28.1178, -53.8022], atol=1e-4
    )
    assert scene.tracks.heading_rad[agent, 6] == pytest.approx(-2.0349, abs=1e-5)
    assert scene.tracks.speed_mps[agent, 6] == pytest.approx(13.6246, abs=1e-5)
    shown = {i: SignalState(k).name for i, k in zip(scene.signals.signal_id, scene.signals.state[:, 5], strict=True)}
    expected = dict.fromkeys(("3772", "3773", "3775", "3778"), "RED") | dict.fromkeys(("3776", "3777", "3779"), "GREEN")
    assert shown == expected | {"3774": "DARK"}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("</state>", "</stbte>", "no XML"),
        ("</state>", "</state> <open>", "no XML"),
        ("<trajectory>", "<trajectory>&unknown;", "no XML"),
        ("<commonRoad", '<!DOCTYPE commonRoad [<!ENTITY a "<trajectory>">]><commonRoad', "document type"),
    ],
)
def test_what_is_no_xml_within_a_trajectory_is_refused(tmp_path, old, new, says):
    path = commonroad.write(tmp_path)
    text = path.read_text()
    at = text.index(old, text.index("<trajectory>") if old == "</state>" else 0)
    path.write_text(text[:at] + new + text[at + len(old) :])
    with pytest.raises(InputError, match=says):
        list(scenes(path))


def test_words_between_states_do_not_cost_a_state(tmp_path):
    path = commonroad.write(tmp_path)
    (plain,) = scenes(path)
    text = path.read_text()
    at = text.index("</state>", text.index("<trajectory>")) + len("</state>")
    path.write_text(text[:at] + " and then " + text[at:])
    (other,) = scenes(path)
    np.testing.assert_array_equal(other.tracks.position_m, plain.tracks.position_m)
