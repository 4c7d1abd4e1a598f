"""The decision at the yellow, executed: P(stop), decelerations and red-running of every style beside the sources.

    python -m benchmarks.yellow_light [--backend sumo|highway] [--seed 0] [--quick] [--approaches N] [--out FILE.json]
                                      [--keep FILE.jsonl] [--others N]

Single drivers come up to a light so that the time to the stop line at the onset of yellow is uniform on 1 to 6 s
(SUMO: `benchmarks/dilemma`; highway-env: `hw_yellow_light` with the option arrivals: dilemma, on ten roads of one lane
with a green and a red that are just long enough to leave and to come to a stand). Whether one stopped
(stood before the line) or crossed is read from its track, as are braking and red-running; "drawn" is what it decided
at the onset. Sources and the neutral curve: docs/REFERENCE.md, section 5.
Sets: the six styles and neutral at 20 m/s and 4 s of yellow (Rakha et al. 2007), neutral at 13.9 and 16.7 m/s,
neutral on a wet road (SUMO), and the naturalistic mixture at 13.9 m/s and 3 s of yellow (an urban light, Promet).
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from stylesim.evaluation.approaches import Approaches, yellow_approaches
from stylesim.evaluation.yellow_curve import (
    CurveBin,
    cochran_armitage,
    curve_rmse,
    deceleration_near,
    decreases,
    ran_red,
    stop_curve,
)
from stylesim.population import Population
from stylesim.scenario import Scenario, ScenarioParameter, load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.style import STYLE_CLASSES
from stylesim.styles import style_table

NEUTRAL = (2.14, 2.88)  # k in 1/s, m in s; REFERENCE section 5
WET = (2.44, 3.0)
TRID = ((5.6, 2.2), (1.6, 5.9))  # TRID 801675: s before the line, m/s2
TRID_MEAN_MPS2 = 3.27
PROMET_STOPPED, PROMET_RED = 0.33, 0.07
PHASE_S = 14.0  # chosen: a timid driver who comes from 6 s away stands by then, and is gone a green later
MAX_RMSE, TOLERANCE, MAX_P = 0.05, 0.20, 1e-3


def dilemma(backend: str) -> Scenario:
    """The scenario of the benchmark, at 20 m/s and 4 s of yellow."""
    if backend == "sumo":
        return load_scenario(str(Path(__file__).with_name("dilemma")))
    stream = load_scenario("hw_yellow_light")
    longer = {"duration_s": 400.0, "warm_up_s": 5.0, "options": {**stream.options, "arrivals": "dilemma"}}
    fixed = stream.model_copy(update=longer)
    return changed(fixed, speed_limit_mps=20.0, yellow_s=4.0, green_s=PHASE_S, red_s=PHASE_S)


def changed(scenario: Scenario, **values: float) -> Scenario:
    """The scenario with parameters that are the same in every episode."""
    fixed = {
        name: ScenarioParameter(unit=scenario.parameters[name].unit, source="benchmarks.yellow_light", choices=(value,))
        for name, value in values.items()
    }
    return scenario.model_copy(update={"parameters": {**scenario.parameters, **fixed}})


def episodes(backend: Backend, scenario: Scenario, crowd: Population, *, seed: int, n: int) -> Iterator[Scene]:
    """Episodes until they hold `n` drivers."""
    episode = drivers = 0
    while drivers < n:
        scene = backend.run_episode(scenario, crowd, seed=seed, episode=episode)
        episode, drivers = episode + 1, drivers + scene.tracks.n_agents
        COUNTS.update({name: scene.counts.get(name, 0) for name in COUNTED})
        yield scene


COUNTS: Counter[str] = Counter()
COUNTED = ("stop_impossible", "stops_not_executed", "gave_up_at_red", "collisions")  # the second is highway-env's


def run(
    backend: Backend, scenario: Scenario, crowd: Population, *, seed: int, n: int
) -> tuple[Approaches, Counter[str]]:
    """The approaches of about `n` drivers, and what the simulator counted."""
    COUNTS.clear()
    found = yellow_approaches(episodes(backend, scenario, crowd, seed=seed, n=n))
    return found.where(found.free), Counter(COUNTS)


def kept(file: Path | None, key: dict[str, object]) -> tuple[Approaches, Counter[str]] | None:
    """The set of that key from a file of earlier runs, where it is in there."""
    lines = file.read_text().splitlines() if file is not None and file.exists() else []
    for item in map(json.loads, lines):
        if item["key"] == key:
            columns: dict[str, Any] = {name: np.array(values) for name, values in item["columns"].items()}
            columns |= {name: tuple(item["names"][name]) for name in ("style", "unit")}
            return Approaches(**columns, counts=item["left_out"]), Counter(item["counts"])
    return None


def keep(file: Path | None, key: dict[str, object], found: Approaches, counts: Counter[str]) -> None:
    """Add a set to the file, one line each."""
    if file is None:
        return
    columns = {
        field.name: getattr(found, field.name).tolist()
        for field in fields(Approaches)
        if field.name not in ("style", "unit", "counts")
    }
    names = {"style": found.style, "unit": found.unit}
    with file.open("a") as stream:
        line = {"key": key, "names": names, "columns": columns, "left_out": found.counts, "counts": counts}
        stream.write(json.dumps(line) + "\n")


def crowd_of(style: str) -> Population:
    return Population.load("neutral") if style == "neutral" else Population.of(**{style: 1.0})


def verdict(met: bool) -> str:
    return "met" if met else "NOT met"


def print_curve(name: str, bins: tuple[CurveBin, ...], law: tuple[float, float]) -> float:
    rmse = curve_rmse(bins)
    print(f"\n{name}: P(stop) by time to the stop line; published k {law[0]:.2f} 1/s, m {law[1]:.2f} s")
    print("   TTS (s)      n   P(stop)  [Wilson 95 %]   published   deceleration (m/s2)")
    for item in bins:
        low, high = item.stopped.interval
        row = f"  {item.low_s:.2f}-{item.high_s:.2f} {item.stopped.n:6d}   {item.stopped.value:.3f}"
        print(f"{row}   [{low:.3f} .. {high:.3f}]   {item.published:.3f}      {item.deceleration_mps2:5.2f}")
    return rmse


def print_set(name: str, found: Approaches, counts: Counter[str]) -> None:
    known = found.decided >= 0
    differs = int((known & ((found.decided == 1) != found.stopped)).sum())
    stops = found.deceleration_mps2[found.stopped]
    share, impossible = ran_red(found), counts["stop_impossible"] + counts["stops_not_executed"]
    print(
        f"  {name:12s} n {len(found):6d}  speed {found.speed_mps.mean():4.1f} m/s  drawn and done differ {differs}"
        f" ({differs / max(1, len(found)):.2%}; gave up at red {counts['gave_up_at_red']})"
        f"  stop not possible, so gone {impossible}  collisions {counts['collisions']}"
        f"  red {share.value:.4f}  deceleration {stops.mean():.2f} [{np.quantile(stops, 0.15):.1f} / "
        f"{np.quantile(stops, 0.5):.1f} / {np.quantile(stops, 0.85):.1f}]"
    )


def print_decelerations(sets: dict[str, Approaches]) -> None:
    print(
        f"\nDecelerations by time to the stop line (TRID 801675: {TRID[0][1]} at {TRID[0][0]} s, {TRID[1][1]} at "
        f"{TRID[1][0]} s, mean {TRID_MEAN_MPS2} m/s2; target within 20 %)"
    )
    for name, found in sets.items():
        parts = []
        for tts, wanted in TRID:
            got, n = deceleration_near(found, tts)
            met = abs(got / wanted - 1.0) <= TOLERANCE
            parts.append(f"at {tts} s {got:.2f} ({got / wanted - 1:+.0%}, n {n}, {verdict(met)})")
        mean = found.deceleration_mps2[found.stopped].mean()
        met = abs(mean / TRID_MEAN_MPS2 - 1.0) <= TOLERANCE
        parts.append(f"mean {mean:.2f} ({mean / TRID_MEAN_MPS2 - 1:+.0%}, {verdict(met)})")
        response = np.quantile(found.response_s[found.stopped], (0.15, 0.5, 0.85))
        print(f"  {name:22s} {'; '.join(parts)}; begins to brake after {' / '.join(f'{r:.1f}' for r in response)} s")
    print("  Gates et al. 2007 (15 / 50 / 85 %): brake response 0.7 / 1.0 / 1.6 s, deceleration 2.2 / 3.0 / 3.9 m/s2")


def print_red(styles: dict[str, Approaches], urban: Approaches) -> None:
    order = STYLE_CLASSES[::-1]  # from calm to bold
    shares = [ran_red(styles[name]) for name in order]
    print("\nRed-running (front over the line 0.1 s after red or later), 20 m/s, 4 s of yellow, TTS uniform on 1-6 s")
    for name, share in zip(order, shares, strict=True):
        low, high = share.interval
        print(f"  {name:12s} {share.hits:5d} of {share.n:6d}  {share.value:.4f} [{low:.4f} .. {high:.4f}]")
    z, p = cochran_armitage(shares)
    fell = decreases(shares)
    print(
        f"  Cochran-Armitage trend from timid to aggressive: z {z:.1f}, p {p:.1e} (target < {MAX_P:g}): "
        f"{verdict(p < MAX_P)}"
    )
    print(f"  decreases beyond intervals: {len(fell)} (target 0): {verdict(not fell)}")
    edge = urban.tts_s[np.argsort(urban.tts_s)]
    done = np.cumsum(urban.stopped[np.argsort(urban.tts_s)]) / np.arange(1, len(urban) + 1)
    beyond = np.flatnonzero(done >= PROMET_STOPPED)
    limit = float(edge[beyond[beyond > len(edge) // 10][0]]) if (beyond > len(edge) // 10).any() else float("inf")
    zone = urban.where(urban.tts_s <= limit)
    low, high = ran_red(zone).interval
    print(
        f"  naturalistic mixture, 13.9 m/s, 3 s of yellow: red {ran_red(urban).value:.4f} of all; of those "
        f"within {limit:.1f} s, where {zone.stopped.mean():.0%} stop as in Promet, {ran_red(zone).value:.3f} "
        f"[{low:.3f} .. {high:.3f}] (Promet: {PROMET_RED:.2f} of 2168)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--backend", default="sumo", choices=("sumo", "highway"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--approaches", type=int, default=20_600, help="per style; a few are not free and left out")
    parser.add_argument("--others", type=int, help="approaches of every set but the neutral one; as many without it")
    parser.add_argument("--quick", action="store_true", help="a twentieth of the approaches")
    parser.add_argument("--out", type=Path, help="write the figures as JSON, too")
    parser.add_argument("--keep", type=Path, help="sets that are done are kept there, and not run again")
    chosen = parser.parse_args()
    n = chosen.approaches // 20 if chosen.quick else chosen.approaches
    other = n if chosen.others is None else chosen.others
    begun = time.process_time()
    scenario = dilemma(chosen.backend)
    backend = open_backend(chosen.backend)
    print(f"backend {chosen.backend}, seed {chosen.seed}, {n} neutral approaches, {other} per style, uniform in TTS")
    sets: dict[str, Approaches] = {}

    def add(name: str, style: str | Population, count: int, where: Scenario = scenario) -> None:
        crowd = crowd_of(style) if isinstance(style, str) else style
        key: dict[str, object] = {"backend": chosen.backend, "set": name, "seed": chosen.seed, "n": count}
        earlier = kept(chosen.keep, key)
        sets[name], counts = earlier or run(backend, where, crowd, seed=chosen.seed, n=count)
        if earlier is None:
            keep(chosen.keep, key, sets[name], counts)
        print_set(name, sets[name], counts)

    add("neutral", "neutral", n)
    for style in STYLE_CLASSES[::-1]:
        add(style, style, other)
    some = max(other // 2, min(other, 2000))
    add("neutral 13.9", "neutral", some, changed(scenario, speed_limit_mps=13.889, yellow_s=3.0))
    add("neutral 16.7", "neutral", some, changed(scenario, speed_limit_mps=16.667, yellow_s=4.0))
    if "wet_road" in scenario.parameters:
        add("neutral wet", "neutral", some, changed(scenario, wet_road=1.0))
    add("naturalistic", Population.load("naturalistic"), other, changed(scenario, speed_limit_mps=13.889, yellow_s=3.0))
    backend.close()
    table = style_table().parameters
    rmse: dict[str, float] = {}
    curves = {}
    for style in ("neutral", *STYLE_CLASSES):
        own = (getattr(table["yellow_slope_per_s"], style), getattr(table["yellow_midpoint_s"], style))
        law = NEUTRAL if style == "neutral" else own
        curves[style] = stop_curve(sets[style], slope_per_s=law[0], midpoint_s=law[1])
        rmse[style] = print_curve(style, curves[style], law)
    if "neutral wet" in sets:
        curves["neutral wet"] = stop_curve(sets["neutral wet"], slope_per_s=WET[0], midpoint_s=WET[1])
        rmse["neutral wet"] = print_curve("neutral, wet road", curves["neutral wet"], WET)
    least = min(item.stopped.n for item in curves["neutral"])
    print(
        f"\nRMSE to the published neutral curve: {rmse['neutral']:.3f} (target {MAX_RMSE}): "
        f"{verdict(rmse['neutral'] <= MAX_RMSE)}"
    )
    print(
        "RMSE of the others (wet road: published; styles: their own commanded curve at the class's centre): "
        + ", ".join(f"{name} {value:.3f}" for name, value in rmse.items() if name != "neutral")
    )
    print(f"Fewest approaches in a bin of 0.25 s: {least} (target 500)")
    names = {"neutral": "neutral, 20.0 m/s", "neutral 16.7": "neutral, 16.7 m/s", "neutral 13.9": "neutral, 13.9 m/s"}
    print_decelerations({label: sets[name] for name, label in names.items()})
    print_red(sets, sets["naturalistic"])
    print(f"\n{time.process_time() - begun:.0f} s of CPU")
    if chosen.out:
        chosen.out.write_text(
            json.dumps({name: [asdict(item) for item in bins] for name, bins in curves.items()}, indent=1)
        )


if __name__ == "__main__":
    main()
