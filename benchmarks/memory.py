"""Peak memory of labelling and merging a corpus, small and eight times as large: it must not grow with the corpus.

    python -m benchmarks.memory [--episodes 4]

Each measurement is a fresh process (peak resident set, from getrusage). The corpora are ramp_merge episodes.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

TIMES = 8
JOBS = {
    "open and iterate": "for scene in corpus: pass",
    "label (TDBM)": "ss.label(corpus, default_labeler('tdbm'))",
    "merge": "ss.merge([corpus], balance='none', split=(0.5, 0.25, 0.25), seed=0, out=sys.argv[1] + '.merged')",
}
HEAD = """
import resource, sys
import stylesim as ss
from stylesim.labelers.reference import default_labeler
corpus = ss.Corpus(sys.argv[1])
"""
TAIL = "\nprint(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"


def peak_mib(job: str, path: Path) -> float:
    """Peak resident set of one job in a fresh process, MiB."""
    done = subprocess.run(
        [sys.executable, "-c", HEAD + job + TAIL, str(path)], check=True, capture_output=True, text=True
    )
    return int(done.stdout.split()[-1]) / 1024


def main() -> None:
    """Print the table."""
    from stylesim.simulation.generate import generate

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=4)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        paths = {}
        for factor in (1, TIMES):
            paths[factor] = Path(folder) / f"c{factor}"
            generate(
                "ramp_merge", "tdbm_spectrum", episodes=asked.episodes * factor, seed=1, out=paths[factor], workers=2
            )
        print(f"{'job':20}{f'{asked.episodes} episodes':>16}{f'{asked.episodes * TIMES} episodes':>16}{'growth':>10}")
        for name, job in JOBS.items():
            small, large = (peak_mib(job, paths[factor]) for factor in (1, TIMES))
            print(f"{name:20}{small:12.0f} MiB{large:12.0f} MiB{large / small:10.2f}")
    print(f"this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
