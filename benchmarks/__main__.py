"""`make bench`: the benchmarks of minutes, each in a process of its own; `--list` names all, the long ones too."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

SHORT = ("generation", "labelling", "memory", "environment_speed", "training", "yellow_light", "reading")
# Each is run by itself, because it takes an hour or more, needs a trained model or packages of its own, or only makes
# the traffic that the others share (worlds).
LONG = (
    "behaviour_speed",
    "collisions",
    "dose_response",
    "environment_scores",
    "highway_speed",
    "human_limits",
    "logging_ways",
    "paper_table",
    "placebo",
    "populate_cost",
    "rare_styles",
    "scale",
    "stress_models",
    "style_helps",
    "sumo_rl_speed",
    "tiny_quality",
    "twins",
    "worlds",
)


def main() -> None:
    """Run the short ones; exit non-zero if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--list", action="store_true", help="name the benchmarks and run none")
    if parser.parse_args().list:
        print("\n".join([*(f"{name} (run by make bench)" for name in SHORT), *LONG]))
        return
    failed = []
    for name in SHORT:
        print(f"\n== benchmarks.{name} ==", flush=True)
        begin = time.monotonic()
        if subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], check=False).returncode != 0:
            failed.append(name)
        print(f"({name}: {time.monotonic() - begin:.0f} s)", flush=True)
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
