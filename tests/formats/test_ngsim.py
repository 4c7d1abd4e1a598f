import numpy as np
import pytest

from stylesim.datasets.ngsim import scenes
from stylesim.datasets.ngsim_tables import site_of
from stylesim.errors import InputError
from stylesim.tracks import AgentKind
from tests.formats import ngsim_files as ngsim
from tests.formats.traffic import Row


def total(found):
    counts = {}
    for scene in found:
        for key, n in scene.counts.items():
            counts[key] = counts.get(key, 0) + n
    return counts


def test_feet_become_metres_and_the_front_becomes_the_centre(tmp_path):
    path = tmp_path / "portal.csv"
    path.write_text(ngsim.portal_text([("us-101", 5000, ngsim.cars())]))
    (scene,) = scenes(path)
    tracks = scene.tracks
    assert tracks.agent_id == ("1", "2", "3", "4", "5", "6")
    assert tracks.kind.tolist() == [AgentKind.CAR] * 5 + [AgentKind.TRUCK]
    own = [r for r in ngsim.cars() if r.agent == 3]
    place = tracks.position_m[2] + tracks.origin_m - np.array(ngsim.GLOBAL_FT) * 0.3048
    np.testing.assert_allclose(place, [(r.x, r.y) for r in own], atol=0.01)
    np.testing.assert_allclose(tracks.speed_mps[2], [np.hypot(r.vx, r.vy) for r in own], atol=0.01)
    np.testing.assert_allclose(tracks.size_m[2], [4.5, 1.8], atol=0.01)
    assert scene.scenario == "us-101"


def test_the_local_frame_is_the_roads(tmp_path):
    path = tmp_path / "portal.csv"
    path.write_text(ngsim.portal_text([("us-101", 5000, ngsim.cars())]))
    (scene,) = scenes(path, frame="local")
    own = [r for r in ngsim.cars() if r.agent == 3]
    place = scene.tracks.position_m[2] + scene.tracks.origin_m
    np.testing.assert_allclose(place, [(-r.y, r.x) for r in own], atol=0.02)
    with pytest.raises(InputError, match="Did you mean 'global'"):
        list(scenes(path, frame="globl"))


def test_site_and_period_are_the_unit_also_where_times_overlap(tmp_path):
    found = list(scenes(ngsim.sample(tmp_path)))
    assert [(s.unit_id, s.scenario) for s in found] == [
        ("ngsim_peachtree_1163018.6", "peachtree"),
        ("ngsim_peachtree_1163030.3", "peachtree"),
        ("ngsim_us-101_5.0", "us-101"),
    ]
    counts = total(found)
    assert counts["rows_dropped_duplicate"] == 1
    assert counts["rows_dropped_off_clock"] == 1
    assert counts["rows_in"] == 3 * len(ngsim.cars()) + 2


def test_the_original_text_gives_the_same_numbers(tmp_path):
    (tmp_path / "portal.csv").write_text(ngsim.portal_text([("i-80", 5000, ngsim.cars())]))
    folder = tmp_path / "I-80-Emeryville-CA"
    folder.mkdir()
    (folder / "trajectories-0400-0415.txt").write_text(ngsim.original_text(5000, ngsim.cars()))
    (one,), (other,) = scenes(tmp_path / "portal.csv"), scenes(folder)
    assert (other.scenario, other.unit_id) == ("i-80", one.unit_id)
    for name in ("position_m", "velocity_mps", "heading_rad", "size_m", "kind", "valid"):
        np.testing.assert_array_equal(getattr(one.tracks, name), getattr(other.tracks, name))


def test_identifiers_that_are_used_again_are_other_vehicles(tmp_path):
    table = ngsim.cars()
    first = [r for r in table if r.agent == 1]
    later = [Row(**{**vars(r), "frame": r.frame + 300, "length": r.length + 2}) for r in first]
    path = tmp_path / "portal.csv"
    path.write_text(ngsim.portal_text([("us-101", 5000, table + later)]))
    found = list(scenes(path, scene_s=100.0))
    assert found[0].tracks.agent_id == ("1", "1/2", "2", "3", "4", "5", "6")


def test_wrong_units_and_other_tables_are_refused(tmp_path):
    path = tmp_path / "portal.csv"
    text = ngsim.portal_text([("us-101", 5000, [Row(**{**vars(r), "length": r.length * 3.3}) for r in ngsim.cars()])])
    path.write_text(text)
    with pytest.raises(InputError, match="lengths must be metres"):
        list(scenes(path))
    path.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="no table of NGSIM"):
        list(scenes(path))
    path.write_text(text.splitlines()[0] + "\n")
    with pytest.raises(InputError, match="empty CSV"):
        list(scenes(path))
    assert site_of(tmp_path / "US101" / "x.txt") == "us-101"


def test_the_real_sample(shared_data):
    folder = shared_data / "ngsim"
    if not folder.is_dir():
        pytest.skip(f"no table of NGSIM at {folder}")
    found = list(scenes(folder))
    counts = total(found)
    assert counts["rows_in"] == 10_000
    assert {s.unit_id for s in found} == {"ngsim_peachtree_1163018.6", "ngsim_peachtree_1163030.3"}
    assert counts["rows_in"] - counts["rows_out"] == counts["rows_dropped_heading_unknown"] == 191
    speeds = np.concatenate([s.tracks.speed_mps[s.tracks.valid] for s in found])
    assert 3.0 < speeds[speeds > 1].mean() < 15.0  # a street with lights, 35 mph


def test_a_frame_number_beyond_all_bounds_is_one_unreadable_row(tmp_path):
    path = tmp_path / "portal.csv"
    text = ngsim.portal_text([("us-101", 5000, ngsim.cars())])
    header, first, rest = text.split("\n", 2)
    fields = first.split(",")
    fields[header.lower().split(",").index("frame_id")] = "1e308"
    path.write_text("\n".join([header, ",".join(fields), rest]))
    assert total(scenes(path))["rows_dropped_unreadable"] == 1
