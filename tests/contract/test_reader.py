"""What every reader must keep; to test another one, add its name and how to write a file in its format."""

from collections import Counter

import numpy as np
import pytest

from stylesim.corpus import Corpus
from stylesim.corpus.verify import verify
from stylesim.datasets import FORMATS, read
from stylesim.datasets.accounting import checked
from stylesim.tracks import AgentKind
from tests.formats import av2_files, dlr_files


def _dlr(folder):
    table = dlr_files.rows(n_frames=900, interpolated=((0, 30), (0, 31), (1, 899)))
    table[3]["timestamp"] = "garbage"
    dlr_files.write(folder, table)
    dlr_files.write_lights(folder, [(float(t), 1, 3 + 2 * (t % 2)) for t in range(45)])


def _av2(folder):
    for name in ("a", "b"):
        av2_files.write(folder / "train", scenario_id=name)


WRITERS = {"dlr_ut": _dlr, "av2": _av2}


def test_every_format_has_its_contract_test():
    assert set(WRITERS) == set(FORMATS)


@pytest.fixture(params=sorted(WRITERS))
def made(request, tmp_path):
    folder = tmp_path / "source"
    folder.mkdir()
    WRITERS[request.param](folder)
    return request.param, folder, tmp_path


def test_scenes_are_sound(made):
    name, folder, _ = made
    found = list(FORMATS[name].scenes()(folder))
    assert len({s.scene_id for s in found}) == len(found) > 0
    total: Counter[str] = Counter()
    for scene in found:
        total.update(scene.counts)
        tracks = scene.tracks
        assert scene.source == name
        assert tracks.dt_s == pytest.approx(0.1)
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
