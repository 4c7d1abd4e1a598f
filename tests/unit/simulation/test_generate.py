"""`generate`: what it refuses, the same bytes whatever happens, and what is kept when it fails."""

from __future__ import annotations

import errno
import json
import os
import signal

import pytest
import yaml

pytest.importorskip("highway_env")

from stylesim.corpus import files as corpus_files
from stylesim.errors import CorpusError, InputError, SimulationError
from stylesim.resources import scenarios_dir
from stylesim.scenario import load_scenario
from stylesim.simulation import pool
from stylesim.simulation.generate import generate, realised_styles


def tiny(folder, name="tiny", **options):
    """A scenario of the highway that takes a fraction of a second."""
    raw = yaml.safe_load((scenarios_dir() / "highway" / "scenario.yaml").read_text())
    raw |= {"name": name, "duration_s": 2.0, "warm_up_s": 0.5}
    raw["options"] |= {"vehicles": 4, "simulation_hz": 10, **options}
    (folder / name).mkdir(exist_ok=True)
    (folder / name / "scenario.yaml").write_text(yaml.safe_dump(raw))
    return load_scenario(str(folder / name))


@pytest.fixture
def scenario(tmp_path):
    return str(tiny(tmp_path).folder)


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """sha256 of the corpus that an undisturbed run makes."""
    folder = tmp_path_factory.mktemp("straight")
    return run(str(tiny(folder).folder), folder / "out").fingerprint


@pytest.fixture
def processes(monkeypatch):
    """Every worker process that was started."""
    started = []

    class Recorded(pool.Worker):
        def __init__(self):
            super().__init__()
            started.append(self.process)

    monkeypatch.setattr(pool, "Worker", Recorded)
    return started


def run(scenario, out, **changes):
    request = {"population": "tdbm_spectrum", "episodes": 4, "seed": 7, **changes}
    return generate(scenario, request.pop("population"), out=out, **request)


def test_one_and_two_workers_give_the_same_bytes(straight, scenario, tmp_path, processes):
    seen = []
    two = run(scenario, tmp_path / "two", workers=2, progress=lambda done, total: seen.append((done, total)))
    assert two.fingerprint == straight
    assert seen == [(n, 4) for n in range(5)]
    assert len(processes) == 2
    assert all(process.returncode is not None for process in processes)
    assert json.loads((tmp_path / "two" / "run.json").read_text())["workers"] == 2
    assert "workers" not in (tmp_path / "two" / "corpus.json").read_text()
    assert str(tmp_path) not in (tmp_path / "two" / "corpus.json").read_text()


def test_several_scenarios_are_one_corpus_with_their_styles_counted(tmp_path):
    folders = [str(tiny(tmp_path, name).folder) for name in ("first", "second")]
    corpus = run(folders, tmp_path / "out", episodes=2)
    assert [(info.part, info.scene_id) for info in corpus.info] == [
        (0, "first-7-00000"),
        (1, "first-7-00001"),
        (2, "second-7-00000"),
        (3, "second-7-00001"),
    ]
    styles = realised_styles(corpus)
    assert sum(styles["first"].values()) == sum(styles["second"].values()) == 8
    named = {f"drivers.{name}" for counts in styles.values() for name in counts}
    assert sum(corpus.manifest["counts"][name] for name in named) == 16


def test_a_killed_worker_is_replaced_and_nothing_is_lost(straight, scenario, tmp_path, processes):
    def kill(done, total):
        if done == 1:
            for process in processes:
                process.send_signal(signal.SIGKILL)

    wounded = run(scenario, tmp_path / "wounded", progress=kill)
    assert wounded.fingerprint == straight
    assert json.loads((tmp_path / "wounded" / "run.json").read_text())["workers_that_died"] >= 1


def test_a_worker_that_dies_twice_is_an_error_that_names_the_episode(straight, scenario, tmp_path, monkeypatch):
    class Doomed(pool.Worker):
        def ask(self, message, place):
            if message.get("task", [0, 0, 0])[2] == 2:
                self.process.kill()
            super().ask(message, place)

    monkeypatch.setattr(pool, "Worker", Doomed)
    with pytest.raises(SimulationError, match=r"scenario 'tiny', episode 2: .*died 2 times \(killed by SIGKILL") as e:
        run(scenario, tmp_path / "out")
    assert "--resume" in str(e.value)
    monkeypatch.undo()
    resumed = run(scenario, tmp_path / "out", resume=True)
    assert resumed.fingerprint == straight
    assert json.loads((tmp_path / "out" / "run.json").read_text())["resumed_episodes"] == 2


def test_ctrl_c_stops_the_workers_keeps_what_is_done_and_can_be_resumed(straight, scenario, tmp_path, processes):
    def interrupt(done, total):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(scenario, tmp_path / "out", workers=2, progress=interrupt)
    assert all(process.returncode is not None for process in processes)
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="--resume"):
        run(scenario, tmp_path / "out")
    with pytest.raises(InputError, match="other settings"):
        run(scenario, tmp_path / "out", seed=8, resume=True)
    (tmp_path / "out.partial" / "tracks" / ".part-00009.parquet.1.tmp").write_bytes(b"left by a killed worker")
    seen = []
    resumed = run(scenario, tmp_path / "out", resume=True, progress=lambda done, _: seen.append(done))
    assert seen[0] >= 2
    assert resumed.fingerprint == straight
    assert not list((tmp_path / "out").rglob(".*"))


def test_a_full_disk_in_the_parent_is_said_and_leaves_no_corpus(scenario, tmp_path, monkeypatch):
    write = corpus_files.Path.write_bytes

    def full(self, content):
        if "corpus.json" in self.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))
        return write(self, content)

    monkeypatch.setattr(corpus_files.Path, "write_bytes", full)
    with pytest.raises(CorpusError, match="disk is full"):
        run(scenario, tmp_path / "out", episodes=1)
    assert not (tmp_path / "out").exists()
    monkeypatch.undo()
    assert len(run(scenario, tmp_path / "out", episodes=1, resume=True)) == 1


def test_a_finished_corpus_is_only_returned_for_the_same_request(scenario, tmp_path):
    corpus = run(scenario, tmp_path / "out", episodes=1)
    with pytest.raises(InputError, match="there already"):
        run(scenario, tmp_path / "out", episodes=1)
    assert run(scenario, tmp_path / "out", episodes=1, resume=True).fingerprint == corpus.fingerprint
    with pytest.raises(InputError, match="other settings"):
        run(scenario, tmp_path / "out", episodes=2, resume=True)


def test_a_scenario_that_cannot_run_is_an_error_of_the_user(tmp_path):
    bad = str(tiny(tmp_path, "bad", vehicle=3).folder)
    with pytest.raises(InputError, match="did you mean 'vehicles'"):
        run(bad, tmp_path / "out")
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"episodes": 0}, "episodes must be"),
        ({"seed": -1}, "seed must be"),
        ({"workers": 0}, "workers must be"),
        ({"workers": True}, "workers must be"),
        ({"population": "tdbm_spectrun"}, "tdbm_spectrum"),
    ],
)
def test_nonsense_is_refused_before_any_work(scenario, tmp_path, processes, changes, says):
    with pytest.raises(InputError, match=says):
        run(scenario, tmp_path / "out", **changes)
    assert not processes
    assert not list(tmp_path.glob("out*"))


def test_unknown_and_repeated_scenarios_are_refused(scenario, tmp_path):
    with pytest.raises(InputError, match="Did you mean 'highway'"):
        run("highwy", tmp_path / "out")
    with pytest.raises(InputError, match="named 2 times"):
        run([scenario, scenario], tmp_path / "out")
    with pytest.raises(InputError, match="no scenario"):
        run([], tmp_path / "out")
