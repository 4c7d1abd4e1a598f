import numpy as np
import polars as pl
import pytest

from stylesim.datasets import read
from stylesim.datasets.table import scenes
from stylesim.errors import InputError
from stylesim.tracks import AgentKind
from tests.formats import table_files
from tests.formats.traffic import rows

MAP = "id=who,time=t,x=center_x,y=y"


def plain(**options):
    table = rows(**options)
    return pl.DataFrame(
        {
            "who": [str(r.agent) for r in table], "t": [r.t for r in table], "center_x": [r.x for r in table],
            "y": [r.y for r in table], "frame": [r.frame for r in table], "what": [r.kind.name for r in table],
        }
    )  # fmt: skip


def test_units_axes_and_clocks_of_the_file_beside_the_table(tmp_path):
    found = list(scenes(table_files.write(tmp_path)))
    assert [(s.unit_id, s.scenario) for s in found] == [
        ("table_tracks_monday", "made crossing"), ("table_tracks_tuesday", "made crossing"),
    ]  # fmt: skip
    tracks = found[0].tracks
    own = [r for r in rows() if r.agent == 2]
    np.testing.assert_allclose(tracks.position_m[1] + tracks.origin_m, [(r.x, r.y) for r in own], atol=1e-3)
    np.testing.assert_allclose(tracks.velocity_mps[1, :, 0], [r.vx for r in own], atol=1e-3)
    np.testing.assert_allclose(tracks.heading_rad[1], [r.heading for r in own], atol=1e-5)
    np.testing.assert_allclose(tracks.size_m[1], [4.4, 1.8], atol=1e-4)
    assert tracks.kind.tolist()[5:] == [AgentKind.TRUCK, AgentKind.PEDESTRIAN]


@pytest.mark.parametrize("ending", ["csv", "csv.gz", "parquet"])
def test_a_bare_table_needs_only_places_and_times(tmp_path, ending):
    path = tmp_path / f"tracks.{ending}"
    if ending == "parquet":
        plain().write_parquet(path)
    else:
        text = plain().write_csv()
        import gzip

        path.write_bytes(gzip.compress(text.encode()) if ending == "csv.gz" else text.encode())
    (scene,) = scenes(path, map=MAP + ",kind=what")
    own = [r for r in rows() if r.agent == 2]
    np.testing.assert_allclose(scene.tracks.position_m[1], [(r.x, r.y) for r in own], atol=1e-3)
    assert scene.tracks.kind.tolist()[5:] == [AgentKind.TRUCK, AgentKind.PEDESTRIAN]
    assert scene.counts["rows_in"] == scene.counts["rows_out"] == plain().height


def test_frames_need_a_rate_and_fast_clocks_come_to_ten_hertz(tmp_path):
    path = tmp_path / "tracks.csv"
    plain(n_frames=300, dt_s=0.04).write_csv(path)
    mapping = "id=who,frame=frame,x=center_x,y=y"
    (scene,) = scenes(path, map=mapping, rate_hz=25.0)
    assert scene.tracks.n_frames == 120
    truth = [r for r in rows(n_frames=120) if r.agent == 2]
    np.testing.assert_allclose(scene.tracks.position_m[1, 2:, 0], [r.x for r in truth[2:]], atol=2e-3)
    with pytest.raises(InputError, match="frames need a rate"):
        list(scenes(path, map=mapping))


def test_compass_degrees_and_the_middle_of_the_front(tmp_path):
    table = rows()
    path = tmp_path / "tracks.csv"
    pl.DataFrame(
        {
            "who": [str(r.agent) for r in table], "t": [r.t for r in table],
            "center_x": [r.x + r.length / 2 * np.cos(r.heading) for r in table],
            "y": [r.y + r.length / 2 * np.sin(r.heading) for r in table],
            "dir": [90 - np.degrees(r.heading) for r in table], "l": [r.length for r in table],
            "w": [r.width for r in table],
        }
    ).write_csv(path)  # fmt: skip
    mapping = MAP + ",heading=dir,length=l,width=w"
    (scene,) = scenes(path, map=mapping, angle="compass degrees", position="front")
    own = [r for r in table if r.agent == 2]
    np.testing.assert_allclose(scene.tracks.position_m[1], [(r.x, r.y) for r in own], atol=1e-3)
    with pytest.raises(InputError, match="degrees off the direction of motion"):
        list(scenes(path, map=mapping, angle="degrees"))


@pytest.mark.parametrize(
    ("mapping", "options", "says"),
    [
        ("id=who,time=t,x=centre_x,y=y", {}, "has no column centre_x; it has: who, t, center_x"),
        ("id=who,time=t,x=center_x", {}, "no column is named for y"),
        ("id=who,x=center_x,y=y", {}, "either time or frame"),
        ("id=who,time=t,x=center_x,y=y,z=y", {}, "unknown meaning of a column 'z'"),
        ("who", {}, "expected MEANING=COLUMN"),
        (MAP, {"unit": "fet"}, "Did you mean 'feet'"),
        (MAP, {"unit": "10"}, "faster than"),
        (MAP, {"time_unit": "ms"}, "Are the times in other units"),
        (MAP, {"kind": "cra"}, "Did you mean 'car'"),
        (MAP, {"angle": "grad"}, "angle"),
        (MAP + ",kind=who", {}, None),
    ],
)
def test_what_is_wrong_is_said(tmp_path, mapping, options, says):
    path = tmp_path / "tracks.csv"
    plain().write_csv(path)
    if says is None:  # kinds that nobody knows are OTHER
        assert set(next(iter(scenes(path, map=mapping))).tracks.kind.tolist()) == {AgentKind.OTHER}
        return
    with pytest.raises(InputError, match=says):
        list(scenes(path, map=mapping, **options))


def test_read_takes_the_mapping_as_an_option(tmp_path):
    plain().write_csv(tmp_path / "tracks.csv")
    corpus = read("table", tmp_path / "tracks.csv", out=tmp_path / "out", map=MAP, rate_hz="10")
    assert len(corpus) == 1
    with pytest.raises(InputError, match=r"no such file: .*tracks\.columns\.yaml"):
        read("table", tmp_path / "tracks.csv", out=tmp_path / "other")
