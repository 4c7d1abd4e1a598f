"""What every reader must keep; tests/formats/<name>_files.py writes a small data set with `sample(folder) -> path`."""

import importlib
from collections import Counter

import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.corpus.verify import verify
from stylesim.datasets import FORMATS, read
from stylesim.datasets.accounting import checked
from stylesim.datasets.formats import recognised
from stylesim.errors import InputError
from stylesim.tracks import AgentKind


def sample(name, folder):
    """A small data set of that format in `folder`; the path that a user would give."""
    folder.mkdir(parents=True, exist_ok=True)
    return importlib.import_module(f"tests.formats.{name}_files").sample(folder)


@pytest.fixture(params=sorted(FORMATS))
def made(request, tmp_path):
    return request.param, sample(request.param, tmp_path / "source"), tmp_path


def test_scenes_are_sound(made):
    name, folder, _ = made
    found = list(FORMATS[name].scenes()(folder))
    assert len({s.scene_id for s in found}) == len(found) > 0
    total: Counter[str] = Counter()
    for scene in found:
        total.update(scene.counts)
        tracks = scene.tracks
        assert scene.source == name
        assert tracks.dt_s == pytest.approx(FORMATS[name].dt_s)
        assert tracks.valid.any(axis=1).all(), "an agent without a frame"
        assert set(tracks.kind.tolist()) <= {int(k) for k in AgentKind}
        assert (tracks.size_m > 0).all()
        assert np.abs(tracks.position_m[tracks.valid]).max() < 5_000.0, "positions are not relative to an origin nearby"
        np.testing.assert_array_equal(np.isnan(tracks.position_m).any(axis=-1), ~tracks.valid)
        np.testing.assert_array_equal(np.isnan(tracks.heading_rad), ~tracks.valid)
        assert all(driver is None for driver in tracks.driver), "a recording knows no commanded style"
    checked(total, steps=sum(int(s.tracks.valid.sum()) for s in found), where=name)


def test_reading_twice_gives_the_same_bytes_and_a_sound_corpus(made):
    name, folder, tmp = made
    calls = []
    one = read(name, folder, out=tmp / "one", progress=lambda done, total: calls.append(done))
    other = read(name, folder, out=tmp / "other")
    assert one.fingerprint == other.fingerprint
    assert calls == list(range(1, len(one) + 1))
    counts = one.manifest["counts"]
    assert counts["rows_in"] == counts["rows_out"] + sum(n for k, n in counts.items() if k.startswith("rows_dropped_"))
    assert verify(one.path).ok
    assert len(Corpus(one.path)) == len(calls)


def test_the_files_are_recognised_and_by_no_other_reader(made):
    name, path, tmp = made
    assert [f.name for f in FORMATS.values() if f.sniff(path)] == [name]
    assert recognised(path).name == name
    assert read("auto", path, out=tmp / "auto").fingerprint == read(name, path, out=tmp / "named").fingerprint


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_sniffing_never_raises(name, tmp_path):
    (tmp_path / "binary").write_bytes(bytes(range(256)) * 20)
    (tmp_path / "x.csv.gz").write_bytes(b"\x1f\x8b garbage")
    for ending in ("json", "csv", "db", "pkl", "parquet", "tfrecord", "xml", "feather", "shf", "txt"):
        (tmp_path / f"empty.{ending}").touch()
        (tmp_path / f"noise.{ending}").write_bytes(b"\xff\xfe{[<\x00\n" * 50)
    (tmp_path / "dangling.csv").symlink_to(tmp_path / "nowhere")
    for path in (*sorted(tmp_path.iterdir()), tmp_path, tmp_path / "absent"):
        assert FORMATS[name].sniff(path) is False


def test_what_is_of_no_format_or_of_two_is_said(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        recognised(tmp_path / "absent")
    with pytest.raises(InputError, match="of no format"):
        recognised(tmp_path)
    sample("av2", tmp_path)
    sample("dlr_ut", tmp_path)
    with pytest.raises(InputError, match="say which"):
        recognised(tmp_path)


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_what_a_user_is_told(name):
    f = FORMATS[name]
    assert f.description
    assert f.supports
    assert f.licence
    assert f.where
    assert set(f.numbers) <= set(f.options)
