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
WORKERS = "2"
SUMO_EPISODES, HIGHWAY_EPISODES = "24", "24"
SEED = "7"


def stylesim(*words: str | Path, out: Path, resumable: bool = False) -> None:
    """Run one verb unless its output is there."""
    shown = " ".join(str(w.relative_to(ROOT)) if isinstance(w, Path) and w.is_relative_to(ROOT) else str(w) for w in words)
    if out.exists():
        sys.stdout.write(f"\n[there already] stylesim {shown}\n")
        return
    sys.stdout.write(f"\n$ stylesim {shown}\n")
    sys.stdout.flush()
    partial = out.with_name(out.name + ".partial")
    resume = ["--resume"] if resumable and partial.exists() else []
    done = subprocess.run([sys.executable, "-m", "stylesim", *map(str, words), *resume], check=False)
    if done.returncode != 0:
        sys.stderr.write(f"\nthe step failed (exit code {done.returncode}); `make demo` goes on from here when repeated\n")
        raise SystemExit(done.returncode)


def corpora() -> tuple[Path, Path, Path]:
    """Simulated and recorded traffic."""
    sumo, highway, real = RUNS / "sumo", RUNS / "highway", RUNS / "dlr_ut"
    common = ("--population", "tdbm_spectrum", "--seed", SEED, "--workers", WORKERS)
    stylesim("generate", "yellow_light", "ramp_merge", "--episodes", SUMO_EPISODES, *common, "--out", sumo, out=sumo, resumable=True)
    stylesim("generate", "highway", "intersection", "--episodes", HIGHWAY_EPISODES, *common, "--out", highway, out=highway, resumable=True)
    stylesim("read", "dlr_ut", ROOT / "data" / "dlr_ut", "--out", real, out=real, resumable=True)
    return sumo, highway, real


def main() -> None:
    """Generate, read, label, merge, train, evaluate."""
    begin = time.monotonic()
    RUNS.mkdir(parents=True, exist_ok=True)
    parts = corpora()
    for method in ("tdbm", "kdsc"):
        for corpus in parts:
            stylesim("label", corpus, "--method", method, out=corpus / "labels" / f"{method}.history.json")
    mixed = RUNS / "mixed"
    stylesim("merge", *parts, "--balance", "tdbm", "--split", "0.6,0.15,0.25", "--seed", SEED, "--out", mixed, out=mixed)
    for method in ("tdbm", "kdsc"):
        stylesim("label", mixed, "--method", method, out=mixed / "labels" / f"{method}.history.json")
    models = []
    for condition in ("none", "tdbm"):
        model = RUNS / f"model_{condition}"
        models.append(model)
        stylesim("train", mixed, "--condition", condition, "--seed", SEED, "--epochs", "12", "--out", model, out=model, resumable=True)
    report = RUNS / "report"
    stylesim("evaluate", *models, "constant_velocity", mixed, "--by", "tdbm,kdsc,scenario,source", "--out", report, out=report)
    sys.stdout.write(f"\nDone in {time.monotonic() - begin:.0f} s. The report: {report / 'report.html'}\n")


if __name__ == "__main__":
    main()
