"""`make bench`: every benchmark in turn, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import time

NAMES = ("generation", "labelling", "memory", "environment_speed", "training", "yellow_light", "reading")


def main() -> None:
    """Run them; exit non-zero if one failed."""
    failed = []
    for name in NAMES:
        print(f"\n== benchmarks.{name} ==", flush=True)
        begin = time.monotonic()
        if subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], check=False).returncode != 0:
            failed.append(name)
        print(f"({name}: {time.monotonic() - begin:.0f} s)", flush=True)
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
