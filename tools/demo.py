"""The main job, once through: `make demo`.

Each step is a command that a user could type; a step whose output is whole is skipped, so that a second run goes on
where the first was stopped.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RUNS = ROOT / "runs" / "demo"
CROWD = ["--population", "tdbm_spectrum", "--seed", "7", "--workers", "2"]
EPISODES = "6"  # per scenario; chosen, because SUMO episodes log 400 to 480 s and the whole must fit into minutes
MAX_STEPS = "1200"  # of each training; chosen, because two trainings must fit into a few minutes on two cores
SPLIT = "0.5,0.1,0.4"  # more in the test split than usual, so that the recording too has 30 drivers in it


def shown(word: str | Path) -> str:
    """A word of a command as a user in the project's folder would type it."""
    return str(word.relative_to(ROOT)) if isinstance(word, Path) else word


def stylesim(*words: str | Path, out: Path, resumable: bool = False) -> None:
    """Run one verb unless its output is there."""
    line = f"stylesim {' '.join(map(shown, words))}"
    if out.exists():
        sys.stdout.write(f"\n[there already] {line}\n")
        return
    sys.stdout.write(f"\n$ {line}\n")
    sys.stdout.flush()
    partial = out.with_name(out.name + ".partial")
    resume = ["--resume"] if resumable and partial.exists() else []
    done = subprocess.run([sys.executable, "-m", "stylesim", *map(str, words), *resume], check=False)
    if done.returncode != 0:
        sys.stderr.write(f"\nstopped (exit code {done.returncode}); `make demo` goes on from here when repeated\n")
        raise SystemExit(done.returncode)


def generate(out: Path, *scenarios: str) -> Path:
    """Simulated traffic of those scenarios."""
    stylesim("generate", *scenarios, "--episodes", EPISODES, *CROWD, "--out", out, out=out, resumable=True)
    return out


def label(corpus: Path) -> None:
    """TDBM and KDSC labels of one corpus, by the shipped references."""
    for method in ("tdbm", "kdsc"):
        stylesim("label", corpus, "--method", method, out=corpus / "labels" / f"{method}.history.json")


def train(mixed: Path, condition: str) -> Path:
    """One forecaster."""
    model = RUNS / f"model_{condition}"
    options = ["--condition", condition, "--max-steps", MAX_STEPS, "--seed", "7"]
    stylesim("train", mixed, *options, "--out", model, out=model, resumable=True)
    return model


def main() -> None:
    """Generate, read, label, merge, train, evaluate."""
    begin = time.monotonic()
    RUNS.mkdir(parents=True, exist_ok=True)
    simulated = [
        generate(RUNS / "sumo", "yellow_light", "ramp_merge"),
        generate(RUNS / "highway", "highway", "intersection"),
    ]
    real = RUNS / "dlr_ut"
    stylesim("read", "dlr_ut", ROOT / "data" / "dlr_ut", "--out", real, out=real, resumable=True)
    for corpus in (*simulated, real):
        label(corpus)
    mixed = RUNS / "mixed"
    options = ["--balance", "tdbm", "--split", SPLIT, "--seed", "7"]
    stylesim("merge", *simulated, real, *options, "--out", mixed, out=mixed, resumable=True)
    label(mixed)  # does nothing where merging could carry the labels over
    models = [train(mixed, condition) for condition in ("none", "tdbm")]
    report = RUNS / "report"
    strata = ["--by", "tdbm,kdsc,scenario,source"]
    stylesim("evaluate", *models, "constant_velocity", mixed, *strata, "--out", report, out=report)
    sys.stdout.write(f"\nDone in {time.monotonic() - begin:.0f} s. The report: {report / 'report.html'}\n")


if __name__ == "__main__":
    main()
