import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stylesim.datasets import FORMATS, read
from stylesim.datasets.pieces import PIECE_FILES, in_processes, pieces
from stylesim.datasets.sniffing import LOOKED_AT, listed, matching
from stylesim.errors import InputError
from tests.formats import av2_files, dlr_ut_files, womd_files

PIECES = sorted(name for name, known in FORMATS.items() if known.pieces)


@pytest.fixture
def many(tmp_path):
    """Three pieces and a bit of Argoverse scenarios."""
    for number in range(2 * PIECE_FILES + 3):
        av2_files.write(tmp_path / "in" / "train", scenario_id=f"{number:04d}")
    return tmp_path / "in"


def content(corpus):
    return {
        str(path.relative_to(corpus.path)): path.read_bytes()
        for path in sorted(corpus.path.rglob("*"))
        if path.is_file() and path.name != "run.json"
    }


def test_one_worker_and_two_give_the_same_bytes_in_the_order_of_the_files(many, tmp_path):
    one = read("av2", many, out=tmp_path / "one")
    calls = []
    two = read("av2", many, out=tmp_path / "two", workers=2, progress=lambda done, _: calls.append(done))
    assert content(one) == content(two)
    assert [info.source_scenario_id for info in two.info] == [f"{n:04d}" for n in range(2 * PIECE_FILES + 3)]
    assert [scene.scene_id for scene in two] == [info.scene_id for info in two.info]
    assert {info.official_split for info in two.info} == {"train"}
    assert calls == [32, 64, 67]
    assert json.loads((tmp_path / "two" / "run.json").read_text())["workers"] == 2


def test_files_of_many_scenes_are_a_piece_each(tmp_path):
    womd_files.sample(tmp_path / "in")
    one = read("womd", tmp_path / "in", out=tmp_path / "one")
    two = read("womd", tmp_path / "in", out=tmp_path / "two", workers=2)
    assert content(one) == content(two)
    assert len({info.part for info in two.info}) == 2


def test_an_error_names_the_file_and_what_was_finished_is_not_read_again(many, tmp_path):
    bad = many / "train" / "0040" / "scenario_0040.parquet"
    kept = bad.read_bytes()
    bad.write_bytes(kept[:100])
    with pytest.raises(InputError, match="scenario_0040"):
        read("av2", many, out=tmp_path / "out", workers=2)
    assert not (tmp_path / "out").exists()
    assert (tmp_path / "out.partial" / "records" / "pieces" / "0000000.json").is_file()
    bad.write_bytes(kept)
    first = tmp_path / "out.partial" / "tracks" / "part-00000.parquet"
    before = first.stat().st_mtime_ns
    resumed = read("av2", many, out=tmp_path / "out", workers=2, resume=True)
    assert (resumed.path / "tracks" / "part-00000.parquet").stat().st_mtime_ns == before
    assert content(resumed) == content(read("av2", many, out=tmp_path / "straight"))


def test_files_that_came_between_are_noticed(many, tmp_path):
    def stop(done, _):
        if done == PIECE_FILES + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        read("av2", many, out=tmp_path / "out", progress=stop)
    av2_files.write(many / "train", scenario_id="0000a")
    with pytest.raises(InputError, match="held other files"):
        read("av2", many, out=tmp_path / "out", resume=True)


def test_a_killed_run_leaves_no_process_and_resumes(many, tmp_path):
    code = (
        "import os, sys\nfrom stylesim.datasets import read\n"
        "def stop(done, _):\n    import multiprocessing as m\n"
        "    print(*(p.pid for p in m.active_children()), flush=True)\n    os.kill(os.getpid(), 9)\n"
        "if __name__ == '__main__':\n    read('av2', sys.argv[1], out=sys.argv[2], workers=2, progress=stop)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    done = subprocess.run(
        [sys.executable, str(script), str(many), str(tmp_path / "out")], capture_output=True, text=True, check=False
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    children = [int(pid) for pid in done.stdout.split()]
    assert children
    for _ in range(200):
        if not any(_runs(pid) for pid in children):
            break
        time.sleep(0.05)
    assert not any(_runs(pid) for pid in children)
    resumed = read("av2", many, out=tmp_path / "out", workers=2, resume=True)
    assert content(resumed) == content(read("av2", many, out=tmp_path / "straight"))


def _runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.slow
def test_stopping_early_ends_the_processes(many, tmp_path):
    work = pieces(
        FORMATS["av2"].files(many), single=False, root=many, format="av2", options={}, partial=tmp_path / "p.partial"
    )
    answers = in_processes(work, workers=2)
    assert next(answers).scenes == PIECE_FILES
    answers.close()
    assert not multiprocessing.active_children()


def test_other_formats_are_read_by_one_process(tmp_path):
    dlr_ut_files.write(tmp_path / "in", dlr_ut_files.rows(n_frames=300))
    corpus = read("dlr_ut", tmp_path / "in", out=tmp_path / "out", workers=4)
    assert json.loads((corpus.path / "run.json").read_text())["workers"] == 1
    with pytest.raises(InputError, match="at least 1"):
        read("dlr_ut", tmp_path / "in", out=tmp_path / "again", workers=0)


@pytest.mark.parametrize(("name", "file"), [("gpudrive", "{}.json"), ("scenarionet", "{}.pkl"), ("womd", "{}.tfrecord"),
                                            ("nuplan", "{}.db")])  # fmt: skip
def test_no_file_is_lost_in_a_large_folder(tmp_path, name, file):
    for number in range(LOOKED_AT + 5):
        os.close(os.open(tmp_path / file.format(f"{number:05d}"), os.O_CREAT))
    assert len(list(FORMATS[name].files(tmp_path))) == LOOKED_AT + 5
    pattern = file.format("*")
    assert len(matching(tmp_path, pattern)) == LOOKED_AT
    assert len(listed(tmp_path, pattern)) == LOOKED_AT + 5


def test_the_formats_in_pieces():
    assert PIECES == ["av2", "gpudrive", "lyft", "nuplan", "scenarionet", "womd"]
