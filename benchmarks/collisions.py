"""How often do drivers of each style cause a collision? Exposure, charged drivers, Poisson intervals.

    python -m benchmarks.collisions --folder runs/collisions [--km 10000] [--scenarios motorway corridor …] [--seed 61]

Simulates episodes of mixed traffic (`tdbm_spectrum`, no stressors) of several SUMO scenarios in turn until every style
has driven `--km` kilometres, or `--minutes` are over. Nothing but counts is kept: one line of JSON for each episode in
`FOLDER/episodes.jsonl`, so that a second call goes on where the first one ended. Collisions are pairs of logged boxes
that come to overlap (`evaluation.collisions`, which charges the one behind, the one that moved over, the one that ran
red or whose front hit); SUMO's own reports, which know nothing of lane changes under way, stand beside. Targets:
none by careful, cautious and timid drivers, at most 1 per 1,000 km by aggressive ones.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.human_limits import PER_KM, poisson_interval
from stylesim.evaluation.collisions import collisions_of
from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import open_backend
from stylesim.style import STYLE_CLASSES

SCENARIOS = ("motorway", "ramp_merge", "lane_drop", "motorway", "corridor", "yellow_light", "signalised", "roundabout")
MOST = {"careful": 0.0, "cautious": 0.0, "timid": 0.0, "aggressive": 1.0}  # per 1,000 km
NAME = "episodes.jsonl"


def counted(scene: Scene) -> dict[str, Any]:
    """What one episode adds: km and charged collisions by style, how they came about, and SUMO's own count."""
    tracks = scene.tracks
    names = [driver.name if driver is not None else "" for driver in tracks.driver]
    metres = np.nansum(tracks.speed_mps, axis=1) * tracks.dt_s
    km = {name: float(sum(m for m, n in zip(metres, names, strict=True) if n == name)) / 1000 for name in STYLE_CLASSES}
    found, at_first_sight = collisions_of(scene)
    charged = Counter(names[place] for one in found for place in one.charged)
    return {
        "km": km,
        "charged": dict(charged),
        "how": dict(Counter(one.how for one in found)),
        "sumo": scene.counts["collisions"],
        "at_first_sight": at_first_sight,
        "drivers": tracks.n_agents,
    }


def done_before(path: Path) -> list[dict[str, Any]]:
    """The episodes of earlier calls; a line that was cut off is left out."""
    if not path.is_file():
        return []
    whole = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    return [json.loads(line) for line in whole]


def totals(rows: list[dict[str, Any]]) -> tuple[dict[str, float], Counter[str]]:
    """Kilometres and charged collisions of each style."""
    km = {name: sum(row["km"][name] for row in rows) for name in STYLE_CLASSES}
    return km, sum((Counter(row["charged"]) for row in rows), Counter())


def report(rows: list[dict[str, Any]]) -> None:
    """Print the tables."""
    km, charged = totals(rows)
    print(
        f"{len(rows)} episodes, {sum(row['drivers'] for row in rows)} drivers, population tdbm_spectrum, no stressors"
    )
    for name in STYLE_CLASSES:
        low, high = poisson_interval(charged[name], max(km[name], 1e-9))
        rate = PER_KM * charged[name] / max(km[name], 1e-9)
        target = f"(target <= {MOST[name]:g})" if name in MOST else ""
        print(f"{name:12s} {km[name]:8.0f} km {charged[name]:4d} charged: {rate:.2f} [{low:.2f}, {high:.2f}] {target}")
    for scenario in sorted({row["scenario"] for row in rows}):
        own = [row for row in rows if row["scenario"] == scenario]
        how: Counter[str] = sum((Counter(row["how"]) for row in own), Counter())
        way = sum(sum(row["km"].values()) for row in own)
        print(
            f"  {scenario}: {len(own)} episodes, {way:.0f} km, logged boxes {dict(how) or 'none'}, "
            f"SUMO says {sum(row['sumo'] for row in own)}, put onto each other {sum(r['at_first_sight'] for r in own)}"
        )


def main() -> None:
    """Go on until there is enough, then print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--km", type=float, default=10_000.0)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--seed", type=int, default=61)
    parser.add_argument("--calibration", default="", help="a file of `stylesim calibrate` to drive by")
    asked = parser.parse_args()
    crowd = Population.load("tdbm_spectrum")
    if asked.calibration:
        crowd = crowd.calibrated(asked.calibration)
    asked.folder.mkdir(parents=True, exist_ok=True)
    path = asked.folder / NAME
    rows = done_before(path)
    backend, until = open_backend("sumo"), time.monotonic() + 60.0 * asked.minutes
    with path.open("a", encoding="utf-8") as file:
        for number in itertools.count(len(rows)):
            if min(totals(rows)[0].values()) >= asked.km or time.monotonic() > until:
                break
            episode, place = divmod(number, len(asked.scenarios))
            name = asked.scenarios[place]
            scene = backend.run_episode(load_scenario(name), crowd, seed=asked.seed + place, episode=episode)
            rows.append({"scenario": name, **counted(scene)})
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
    backend.close()
    report(rows)


if __name__ == "__main__":
    main()
