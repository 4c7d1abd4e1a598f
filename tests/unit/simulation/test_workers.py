"""The worker process: its messages, what it writes, and that it never outlives its parent."""

from __future__ import annotations

import errno
import json
import subprocess
import sys

import pytest

from stylesim.corpus import CorpusWriter
from stylesim.corpus import files as corpus_files
from stylesim.errors import CorpusError, InputError, SimulationError
from stylesim.population import Population
from stylesim.simulation import workers
from stylesim.simulation.plan import PLAIN
from stylesim.simulation.pool import raised
from stylesim.simulation.workers import EpisodeRunner, Job, Task, failure, with_driver_counts
from tests.conftest import make_scene
from tests.unit.simulation.test_generate import tiny


class MadeBackend:
    """Runs no simulator."""

    name = "made"

    def run_episode(self, scenario, population, *, seed, episode, plan=PLAIN):
        if episode == 13:
            raise SimulationError("no luck")
        return make_scene(f"{scenario.name}-{seed}-{episode:05d}", n_frames=20, n_agents=3)

    def close(self):
        pass


@pytest.fixture
def job(tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "open_backend", lambda name: MadeBackend())
    partial = tmp_path / "out.partial"
    return Job((tiny(tmp_path),), Population.load("rare_heavy"), 4, partial)


def test_a_job_survives_the_pipe(job):
    assert Job.from_dict(json.loads(json.dumps(job.to_dict()))) == job


def test_an_episode_becomes_a_part_with_its_drivers_counted(job, tmp_path):
    EpisodeRunner(job).run(Task(2, 0, 5))
    writer = CorpusWriter(tmp_path / "other", source="made", configuration={})
    assert json.loads((job.partial / "records" / "00002.json").read_text())["scenes"][0]["scene_id"] == "tiny-4-00005"
    assert writer.done_parts() == set()
    scene = with_driver_counts(make_scene())
    assert sum(n for name, n in scene.counts.items() if name.startswith("drivers.")) == scene.tracks.n_agents


def test_a_full_disk_in_a_worker_is_said_and_leaves_nothing(job, monkeypatch):
    def full(self, content):
        raise OSError(errno.ENOSPC, "No space left on device", str(self))

    monkeypatch.setattr(corpus_files.Path, "write_bytes", full)
    with pytest.raises(CorpusError, match=r"disk is full.*--resume") as caught:
        EpisodeRunner(job).run(Task(0, 0, 0))
    assert [path for path in job.partial.rglob("*") if path.is_file()] == []
    back = raised(failure(caught.value, job.partial), "scenario 'tiny', episode 0")
    assert isinstance(back, CorpusError)
    assert str(back) == str(caught.value)


def test_a_full_disk_outside_our_own_writing_is_said_too(job):
    message = failure(OSError(errno.ENOSPC, "No space left on device", "/tmp/x"), job.partial)
    assert message["error"] == "CorpusError"
    assert "disk is full" in message["text"]


@pytest.mark.parametrize(
    ("error", "kind", "text"),
    [
        (InputError("bad key"), InputError, "^bad key"),
        (SimulationError("no luck"), SimulationError, "^scenario 'a', episode 1: no luck"),
        (ZeroDivisionError("oops"), SimulationError, "^scenario 'a', episode 1: ZeroDivisionError: oops"),
    ],
)
def test_errors_travel_back_as_what_they_are(error, kind, text, tmp_path):
    back = raised(failure(error, tmp_path), "scenario 'a', episode 1")
    assert type(back) is kind
    with pytest.raises(kind, match=text):
        raise back
    assert type(error).__name__ in "".join(back.__notes__)


def test_a_worker_ends_when_its_parent_is_gone():
    worker = subprocess.Popen(
        [sys.executable, "-m", "stylesim.simulation.workers"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    worker.stdin.close()
    assert worker.wait(60) == 1
    worker.stdout.close()
    worker.stderr.close()


def test_a_worker_that_cannot_open_its_simulator_says_why_and_stays_usable(tmp_path):
    worker = subprocess.Popen(
        [sys.executable, "-m", "stylesim.simulation.workers"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    message = {"job": {**Job((tiny(tmp_path),), Population.load("rare_heavy"), 4, tmp_path).to_dict()}}
    message["job"]["scenarios"][0]["backend"] = "nonsense"
    answers, _ = worker.communicate(json.dumps(message).encode() + b'\n{"stop": true}\n', timeout=60)
    assert "nonsense" in json.loads(answers)["text"]
    assert worker.returncode == 0
