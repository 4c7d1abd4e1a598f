"""Are styled drivers still drivers that one could meet? Accelerations, jerk and collisions by style.

    python -m benchmarks.human_limits [--scenarios motorway lane_drop …] [--episodes 4] [--seed 31] [--workers 1]
    python -m benchmarks.human_limits --corpus runs/sim
    python -m benchmarks.human_limits --scenarios highway hw_exit --stressor hard_brake,cut_in,deer

From unsmoothed 0.1 s states as logged (differences of the logged velocity along and across the heading): quantiles of
the longitudinal acceleration, outside and within emergencies (a driver's frames from 2 s before to 2 s after one beyond
4.5 m/s2), of the jerk and of the lateral acceleration. Collisions are those of logged boxes, charged to the one behind,
the one that moved over, or the one that ran red (`evaluation.collisions`), per 1,000 vehicle-km with the Poisson
interval (Garwood). Targets beside: |a| <= 8 in an emergency and <= 4.5 otherwise, |jerk| <= 15 at the 99.9th
percentile, lateral <= 4 m/s2; no collision of careful, cautious, timid drivers, <= 1 per 1,000 km of aggressive ones.

With --stressor one more table, by kind of event: the one to whom it was done (its victim), in the 10 s from the event
on. Who caused it is not in it: it does not drive like people.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from stylesim.corpus import Corpus
from stylesim.evaluation.collisions import collisions_of
from stylesim.scene import Scene
from stylesim.simulation.generate import generate
from stylesim.simulation.plan import PLAIN, EpisodePlan, stressors_of
from stylesim.style import STYLE_CLASSES

SUMO = ("motorway", "lane_drop", "ramp_merge", "corridor", "yellow_light")
ORDINARY_MPS2, EMERGENCY_MPS2, JERK_MPS3, LATERAL_MPS2 = 4.5, 8.0, 15.0, 4.0
AROUND_S = 2.0
PERCENTILE = 99.9
PER_KM = 1000.0
AFTER_S = 10.0  # chosen: a hard brake and its wave have passed by then


def motions(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Longitudinal and lateral acceleration, longitudinal jerk, and km of each agent; NaN where they are not known."""
    tracks = scene.tracks
    velocity = tracks.velocity_mps.astype(np.float64)
    dt = tracks.dt_s
    change = np.full_like(velocity, np.nan)
    change[:, 1:] = np.diff(velocity, axis=1) / dt
    heading = tracks.heading_rad.astype(np.float64)
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    along = (change * ahead).sum(axis=-1)
    across = change[..., 1] * ahead[..., 0] - change[..., 0] * ahead[..., 1]
    jerk = np.full_like(along, np.nan)
    jerk[:, 1:] = np.diff(along, axis=1) / dt
    km = np.nansum(np.hypot(velocity[..., 0], velocity[..., 1]), axis=1) * dt / 1000.0
    return along, across, jerk, km


def near_emergency(along: np.ndarray, dt: float) -> np.ndarray:
    """Frames within 2 s of one beyond the ordinary limit, per agent."""
    hit = np.abs(np.nan_to_num(along)) > ORDINARY_MPS2
    reach = round(AROUND_S / dt)
    total = np.cumsum(np.pad(hit, ((0, 0), (reach + 1, reach))), axis=1)
    return (total[:, 2 * reach + 1 :] - total[:, : -2 * reach - 1]) > 0


def poisson_interval(n: int, km: float) -> tuple[float, float]:
    """95 % interval (Garwood) of a rate per 1,000 km."""
    low = chi2.ppf(0.025, 2 * n) / 2 if n else 0.0
    return PER_KM * low / km, PER_KM * chi2.ppf(0.975, 2 * n + 2) / 2 / km


def audit(corpus: Corpus) -> None:
    """Print the table."""
    found: dict[str, dict[str, list[np.ndarray]]] = defaultdict(lambda: defaultdict(list))
    km: dict[str, float] = defaultdict(float)
    charged: dict[str, int] = defaultdict(int)
    how: dict[str, int] = defaultdict(int)
    emergencies: dict[str, int] = defaultdict(int)
    drivers: dict[str, int] = defaultdict(int)
    for scene in corpus:
        along, across, jerk, way = motions(scene)
        emergency = near_emergency(along, scene.tracks.dt_s)
        names = [driver.name if driver is not None else "" for driver in scene.tracks.driver]
        collisions, _ = collisions_of(scene)
        for one in collisions:
            how[one.how] += 1
            for place in one.charged:
                charged[names[place]] += 1
        for name in STYLE_CLASSES:
            own = np.array([n == name for n in names], bool)
            if not own.any():
                continue
            drivers[name] += int(own.sum())
            km[name] += float(way[own].sum())
            emergencies[name] += int((np.abs(np.nan_to_num(along[own])) > ORDINARY_MPS2).any(axis=1).sum())
            kinds = (("ordinary", along, ~emergency), ("emergency", along, emergency), ("jerk", jerk, None),
                     ("lateral", across, None))  # fmt: skip
            for key, value, kept in kinds:
                chosen = value[own] if kept is None else value[own][kept[own]]
                found[name][key].append(np.abs(chosen[np.isfinite(chosen)]).astype(np.float32))
    print(f"{corpus.path.name}: seed {corpus.manifest.get('seed')}, {len(corpus)} episodes")
    print(
        f"{'style':12s} {'drivers':>8s} {'km':>8s} | |a| p{PERCENTILE} (max): ordinary <= 4.5, emergency <= 8 | "
        "|jerk| <= 15 | lateral <= 4 | drivers braking > 4.5 | collisions charged per 1,000 km [95 %]"
    )
    for name in STYLE_CLASSES:
        cells = []
        for key in ("ordinary", "emergency", "jerk", "lateral"):
            value = np.concatenate(found[name][key] or [np.zeros(0, np.float32)])
            cells.append(f"{np.percentile(value, PERCENTILE):5.2f} ({value.max():5.2f})" if len(value) else "   - ")
        low, high = poisson_interval(charged[name], max(km[name], 1e-9))
        rate = PER_KM * charged[name] / max(km[name], 1e-9)
        print(
            f"{name:12s} {drivers[name]:8d} {km[name]:8.0f} | {cells[0]}  {cells[1]} | {cells[2]} | {cells[3]} | "
            f"{emergencies[name]:4d} | {charged[name]:3d}: {rate:.2f} [{low:.2f}, {high:.2f}]"
        )
    print(f"collisions of logged boxes by kind: {dict(how) or 'none'}")


def audit_victims(corpus: Corpus) -> None:
    """Print what the victims of each kind of stressor did."""
    found: dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = defaultdict(list)
    for scene in corpus:
        along, across, jerk, _ = motions(scene)
        for event in scene.metadata.get("events", ()):
            if event["victim"] in scene.tracks.agent_id:
                row, first = scene.tracks.agent_id.index(event["victim"]), round(event["time_s"] / scene.tracks.dt_s)
                span = slice(first, first + round(AFTER_S / scene.tracks.dt_s))
                found[event["kind"]].append((along[row, span], jerk[row, span], across[row, span]))
    print(f"victims in the {AFTER_S:g} s from the event on: |a| <= 8, |jerk| <= 15, lateral <= 4; p{PERCENTILE} (max)")
    for kind, victims in sorted(found.items()):
        cells = []
        for column in range(3):
            value = np.abs(np.concatenate([one[column] for one in victims]))
            value = value[np.isfinite(value)]
            cells.append(f"{np.percentile(value, PERCENTILE):5.2f} ({value.max():5.2f})")
        print(f"{kind:12s} {len(victims):4d} victims | |a| {cells[0]} | |jerk| {cells[1]} | lateral {cells[2]}")


def main() -> None:
    """Read or generate a corpus, print the audit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", type=Path)
    parser.add_argument("--scenarios", nargs="+", default=list(SUMO))
    parser.add_argument("--episodes", type=int, default=4)
    parser.add_argument("--stressor", default="", help="kinds, as for `stylesim generate --stressor`")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    if asked.corpus is not None:
        audit(Corpus(asked.corpus))
        audit_victims(Corpus(asked.corpus))
        return
    plan = EpisodePlan(stressors=stressors_of(asked.stressor)) if asked.stressor else PLAIN
    for name in asked.scenarios:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / name
            corpus = generate(
                name, "tdbm_spectrum", episodes=asked.episodes, seed=asked.seed, out=out, workers=asked.workers,
                plan=plan,
            )  # fmt: skip
            audit(corpus)
            if asked.stressor:
                audit_victims(corpus)


if __name__ == "__main__":
    main()
