"""How far a counterfactual twin reaches: what differs from the episode, by distance from the driver that changes.

python -m benchmarks.twins [--episodes 6] [--at 10] [scenario …]
"""

from __future__ import annotations

import argparse
from itertools import pairwise

import numpy as np

from stylesim.population import Population
from stylesim.scenario import load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import open_backend
from stylesim.simulation.plan import EpisodePlan, TwinRequest
from stylesim.simulation.twins import twins_of

BANDS_M = (0.0, 100.0, 300.0, 1e9)  # from the changed driver, at the moment of the change
AFTER_S = 10.0  # when the deviation is read


def deviations(base: Scene, twin: Scene, driver: str, at_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(distance from the driver at the moment, deviation 10 s later), m, of everybody else who is in both then."""
    before, after = round(at_s / base.tracks.dt_s), round((at_s + AFTER_S) / base.tracks.dt_s)
    both = [name for name in base.tracks.agent_id if name in twin.tracks.agent_id and name != driver]
    rows = [[s.tracks.agent_id.index(name) for name in both] for s in (base, twin)]
    centre = base.tracks.position_m[base.tracks.agent_id.index(driver), before]
    away = np.linalg.norm(base.tracks.position_m[rows[0], before] - centre, axis=1)
    apart = np.linalg.norm(base.tracks.position_m[rows[0], after] - twin.tracks.position_m[rows[1], after], axis=1)
    keep = np.isfinite(away) & np.isfinite(apart)
    return away[keep], apart[keep]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenarios", nargs="*", default=["ramp_merge", "yellow_light", "highway", "hw_merge"])
    parser.add_argument("--episodes", type=int, default=6)
    parser.add_argument("--at", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=20)
    given = parser.parse_args()
    crowd = Population.load("tdbm_spectrum")
    print(f"deviation of others {AFTER_S:g} s after one driver changed at {given.at:g} s, seed {given.seed}")
    print("scenario       variant   band            n   exactly 0   median m   90 % m")
    for name in given.scenarios:
        scenario = load_scenario(name)
        scenario = scenario.model_copy(update={"duration_s": given.at + AFTER_S + 1.0})
        backend = open_backend(scenario.backend)
        found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        for episode in range(given.episodes):
            key = {"seed": given.seed, "episode": episode}
            base = backend.run_episode(scenario, crowd, **key)
            for twin in twins_of(base, TwinRequest(at_s=given.at), crowd, backend=scenario.backend, **key):
                other = backend.run_episode(scenario, crowd, **key, plan=EpisodePlan(twin=twin))
                found.setdefault(twin.name, []).append(deviations(base, other, twin.driver, given.at))
        backend.close()
        for variant, pairs in found.items():
            away, apart = (np.concatenate(values) for values in zip(*pairs, strict=True))
            for low, high in pairwise(BANDS_M):
                band = apart[(away >= low) & (away < high)]
                if len(band):
                    where = f"{low:g}-{high:g} m" if high < 1e9 else f"> {low:g} m"
                    share, middle, much = (band == 0).mean(), np.median(band), np.quantile(band, 0.9)
                    print(f"{name:14} {variant:9} {where:12} {len(band):5} {share:11.2f} {middle:10.3f} {much:8.2f}")


if __name__ == "__main__":
    main()
