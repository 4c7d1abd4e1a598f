"""Scores of the simple egos per environment, as a Markdown table: `python benchmarks/environment_scores.py`."""

from __future__ import annotations

import argparse
import sys

from stylesim.envs.policies import POLICIES
from stylesim.envs.registration import IDS
from stylesim.envs.scores import MEASURES, score


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=50, help="episodes per ego and id (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="episode i is reset with seed + i (default 0)")
    parser.add_argument("--population", default="naturalistic")
    parser.add_argument("--ids", nargs="*", default=sorted(IDS))
    chosen = parser.parse_args()
    print(f"population {chosen.population}, n = {chosen.episodes} episodes, mean [95 % bootstrap interval]\n")
    print("| id | ego | " + " | ".join(MEASURES) + " |")
    print("|---|---|" + "---|" * len(MEASURES))
    for env_id in chosen.ids:
        for ego in POLICIES:
            scores = score(
                env_id, ego, episodes=chosen.episodes, seed=chosen.seed, population=chosen.population, progress=_shown
            )
            cells = [f"{s.mean:.2f} [{s.low:.2f}, {s.high:.2f}]" for s in (scores[name] for name in MEASURES)]
            print(f"| {env_id} | {ego} | " + " | ".join(cells) + " |", flush=True)


def _shown(done: int, total: int) -> None:
    print(f"\r{done}/{total} ", end="" if done < total else "\r", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
