import numpy as np
import pytest

from stylesim.datasets import formats, read
from stylesim.datasets.accounting import AccountingError, added, checked, row_counts
from stylesim.errors import InputError
from tests.formats import dlr_ut_files


def test_an_unknown_format_names_the_nearest(tmp_path):
    with pytest.raises(InputError, match="Did you mean 'dlr_ut'"):
        read("dlr-ut", tmp_path, out=tmp_path / "out")


def test_unknown_options_are_refused(tmp_path):
    with pytest.raises(InputError, match="Did you mean 'scene_s'"):
        read("dlr_ut", tmp_path, out=tmp_path / "out", scenes_s=3)
    with pytest.raises(InputError, match="has no options"):
        read("av2", tmp_path, out=tmp_path / "out", road="none")


def test_a_missing_source_says_where_to_get_it(tmp_path):
    with pytest.raises(InputError, match="zenodo"):
        read("dlr_ut", tmp_path / "nowhere", out=tmp_path / "out")


def test_rows_that_vanish_unsaid_are_an_error():
    checked(row_counts(rows_out=5, dropped={"why": 2}), steps=5, where="here")
    with pytest.raises(AccountingError, match="8 rows in"):
        checked({**row_counts(rows_out=5, dropped={"why": 2}), "rows_in": 8}, steps=5, where="here")
    with pytest.raises(AccountingError, match="4 agent-frames were written"):
        checked(row_counts(rows_out=5), steps=4, where="here")
    assert added({"a": 1}, {"a": 2, "b": 3}) == {"a": 3, "b": 3}


def test_an_interrupted_read_leaves_nothing_under_the_final_name_and_resumes(tmp_path):
    dlr_ut_files.write(tmp_path / "in", dlr_ut_files.rows(n_frames=1700))

    def stop(done, _):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        read("dlr_ut", tmp_path / "in", out=tmp_path / "out", progress=stop)
    assert not (tmp_path / "out").exists()
    again = read("dlr_ut", tmp_path / "in", out=tmp_path / "out", resume=True)
    straight = read("dlr_ut", tmp_path / "in", out=tmp_path / "straight")
    assert again.fingerprint == straight.fingerprint


def test_scene_length_and_road_are_options(tmp_path):
    dlr_ut_files.write(tmp_path / "in", dlr_ut_files.rows(n_frames=800, n_agents=5))
    corpus = read("dlr_ut", tmp_path / "in", out=tmp_path / "out", scene_s=11.0, road="none")
    assert [info.n_frames for info in corpus.info] == [110, 110, 110, 70]
    assert all(scene.road is None for scene in corpus)
    with pytest.raises(InputError, match="at least two frames"):
        read("dlr_ut", tmp_path / "in", out=tmp_path / "bad", scene_s=0.1)
    with pytest.raises(InputError, match="cannot read the road"):
        read("dlr_ut", tmp_path / "in", out=tmp_path / "worse", road="sight")


def test_formats_say_what_they_offer():
    for name, known in formats.FORMATS.items():
        assert known.name == name
        assert known.licence
        assert known.where.startswith(("https://", "your own files"))
        assert np.isfinite(known.rate_hz)
        assert callable(known.scenes())
