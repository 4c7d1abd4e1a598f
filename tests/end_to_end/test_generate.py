"""A run whose parent is killed: the workers end with it, and a resumed run gives the same bytes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from stylesim.corpus import Corpus
from stylesim.corpus.verify import verify
from stylesim.simulation.generate import generate

PROGRAM = """
import sys
from stylesim.simulation import pool
from stylesim.simulation.generate import generate

class Told(pool.Worker):
    def __init__(self):
        super().__init__()
        print("worker", self.process.pid, flush=True)

pool.Worker = Told
generate({scenarios!r}, "tdbm_spectrum", episodes=3, seed=11, out=sys.argv[1], workers=2,
         progress=lambda done, total: print("done", done, flush=True))
"""


def alive(pid: int) -> bool:
    """True while the process runs (a zombie does not)."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def killed_in_the_middle(out: Path, scenarios: list[str]) -> list[int]:
    """Start a run, kill it when two episodes are done; the workers' process ids."""
    program = PROGRAM.format(scenarios=scenarios)
    parent = subprocess.Popen([sys.executable, "-c", program, str(out)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = []
    for line in parent.stdout:
        if line.startswith("worker"):
            workers.append(int(line.split()[1]))
        if line.strip() == "done 2":
            break
    parent.kill()
    parent.wait()
    parent.stdout.close()
    return workers


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="reads /proc and sends SIGKILL")
@pytest.mark.parametrize("scenarios", [["highway", "intersection"], ["yellow_light", "highway"]])
def test_a_killed_run_is_resumed_to_the_same_bytes(tmp_path, scenarios):
    if "yellow_light" in scenarios:
        pytest.importorskip("libsumo")
    out = tmp_path / "killed"
    workers = killed_in_the_middle(out, scenarios)
    assert len(workers) == 2
    deadline = time.monotonic() + 20
    while any(alive(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in workers), "an orphaned worker is still there"
    assert not out.exists()
    request = {"episodes": 3, "seed": 11}
    resumed = generate(scenarios, "tdbm_spectrum", out=out, resume=True, **request)
    straight = generate(scenarios, "tdbm_spectrum", out=tmp_path / "straight", workers=2, **request)
    assert resumed.fingerprint == straight.fingerprint
    found = verify(out)
    assert found.ok, found.errors
    assert len(Corpus(out)) == 6
