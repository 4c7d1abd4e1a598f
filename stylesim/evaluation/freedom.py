"""Which classes a scenario leaves room for: what one neutral driver's vehicle reaches when set to each extreme.

The rule, written before any run: in neutral traffic one driver is set, from his insertion on, to every extreme (each
parameter of the style table at either of its limits with the others neutral; all at their bold or calm limit, also with
the speed wish the other way round; both ends of each class's stretch of the knob). From the features that he is then
measured with, over all extremes and episodes, the least and the greatest of each scaled feature make a box. A class has
"no freedom" in the scenario if no point of that box has it as its highest score. The box holds more than can be reached
at once, so the rule says so too seldom rather than too often.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from stylesim.errors import InputError
from stylesim.evaluation.commanded import LEAST_S
from stylesim.evaluation.fidelity_ranges import scaled_features
from stylesim.labelers.reference import default_labeler
from stylesim.labelers.tdbm import TDBM
from stylesim.labelers.tdbm_matrix import MATRIX
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario, load_scenario
from stylesim.scene import Scene
from stylesim.simulation.backend import Backend, open_backend
from stylesim.simulation.plan import EpisodePlan, Twin
from stylesim.style import CLASS_INTERVAL, PHYSICAL_FIELDS, STYLE_CLASSES, DriverStyle
from stylesim.styles import StyleTable, style_table

EPISODES = 3  # chosen: some 45 extremes an episode; the box is made of more than a hundred drives
VARIANT = "extreme"
SPEED = ("desired_speed_factor", "lane_change_eagerness")


@dataclass(frozen=True, eq=False)
class Freedom:
    """Of one scenario. `reached` are the ends of the box in scaled features; `drives` the measured drives it rests on.

    `margin` is the greatest lead of each class over the best other one within the box: below 0 it has no freedom.
    `best` names the extreme that came nearest to each feature's ends. `too_short` counts drives under 20 s.
    """

    scenario: str
    backend: str
    names: tuple[str, ...]
    reached: Float64[np.ndarray, "feature end"]
    best: tuple[tuple[str, str], ...]
    margin: dict[str, float]
    drives: int
    too_short: int

    def without(self) -> tuple[str, ...]:
        """The classes that have no freedom."""
        return tuple(name for name, lead in self.margin.items() if lead < 0)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "scenario": self.scenario,
            "backend": self.backend,
            "drives": self.drives,
            "too_short": self.too_short,
            "reached": {
                name: {"low": float(low), "high": float(high), "by": list(by)}
                for name, (low, high), by in zip(self.names, self.reached.tolist(), self.best, strict=True)
            },
            "margin": self.margin,
            "no_freedom": list(self.without()),
        }


def extremes(table: StyleTable, *, limit_mps: float | None) -> Iterator[tuple[str, DriverStyle]]:
    """(what, driver) of every extreme that the rule names."""
    neutral = table.at(0.0, limit_mps=limit_mps)
    ends: dict[str, tuple[float, float]] = {}  # calm, bold
    for key in PHYSICAL_FIELDS:
        one = table.parameters[key]
        if not math.isfinite(one.high) or one.low >= one.high:
            continue
        yield f"{key} {one.low:g}", _with(neutral, {key: _allowed(key, one.low)})
        yield f"{key} {one.high:g}", _with(neutral, {key: one.high})
        ends[key] = (one.low, one.high) if one.aggressive >= one.timid else (one.high, one.low)
    for name, side in (("calm", 0), ("bold", 1)):
        all_at = {key: _allowed(key, pair[side]) for key, pair in ends.items()}
        turned = {key: _allowed(key, pair[1 - side] if key in SPEED else pair[side]) for key, pair in ends.items()}
        yield f"all {name}", _with(neutral, all_at)
        yield f"all {name}, {('fast', 'slow')[side]}", _with(neutral, turned)
    for style, interval in CLASS_INTERVAL.items():
        for knob in interval:
            inside = knob + math.copysign(1e-6, sum(interval) / 2 - knob)  # the end itself may be the neighbour's
            yield f"{style} at {knob:g}", table.at(inside, limit_mps=limit_mps)


def _with(style: DriverStyle, values: Mapping[str, Any]) -> DriverStyle:
    return replace(style, **values)


def _allowed(key: str, value: float) -> float:
    """A limit of 0 where a driver must have more than nothing."""
    return value if value > 0 or key not in ("desired_speed_factor", "time_headway_s") else 0.05


def freedom(
    scenarios: Sequence[str],
    *,
    episodes: int = EPISODES,
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> tuple[Freedom, ...]:
    """The box and the verdict of every scenario, by the frozen `sim-reference` scaler.

    `progress` is called with the scenario, the drives done and their number. InputError for an unknown scenario, or
    where no neutral driver is on the road for 20 s; SimulationError where an episode cannot be run.
    """
    if episodes < 1:
        raise InputError(f"freedom needs at least one episode, not {episodes}")
    loaded = [load_scenario(name) for name in scenarios]
    judge = default_labeler("tdbm")
    assert isinstance(judge, TDBM)
    found = []
    for scenario in loaded:
        backend = open_backend(scenario.backend)
        try:
            found.append(_freedom_of(scenario, backend, judge, episodes=episodes, seed=seed, progress=progress))
        finally:
            backend.close()
    return tuple(found)


def _freedom_of(
    scenario: Scenario,
    backend: Backend,
    judge: TDBM,
    *,
    episodes: int,
    seed: int,
    progress: Callable[[str, int, int], None] | None,
) -> Freedom:
    crowd, table = Population.load("neutral"), style_table(backend=scenario.backend)
    rows: list[Float64[np.ndarray, " feature"]] = []
    names: list[str] = []
    too_short = 0
    for episode in range(episodes):
        plain = backend.run_episode(scenario, crowd, seed=seed, episode=episode)
        driver = _probe(plain, seed=seed, episode=episode)
        if driver is None:
            continue
        every = list(extremes(table, limit_mps=plain.parameters.get("speed_limit_mps")))
        for done, (what, style) in enumerate(every, start=1):
            plan = EpisodePlan(twin=Twin(name=VARIANT, driver=driver, style=style, from_style="neutral"))
            scene = backend.run_episode(scenario, crowd, seed=seed, episode=episode, plan=plan)
            row = _measured(scene, driver, judge)
            if row is None:
                too_short += 1
            else:
                rows.append(row)
                names.append(what)
            if progress is not None:
                progress(scenario.name, episode * len(every) + done, episodes * len(every))
    if not rows:
        raise InputError(
            f"{scenario.name}: no neutral driver is on the road for {LEAST_S:g} s in {episodes} episode(s), so that "
            "there is no drive to measure"
        )
    value = np.stack(rows)
    low, high = value.argmin(axis=0), value.argmax(axis=0)
    reached = np.stack([value.min(axis=0), value.max(axis=0)], axis=1)
    return Freedom(
        scenario=scenario.name,
        backend=scenario.backend,
        names=judge.track_scaler_.names,
        reached=reached,
        best=tuple((names[i], names[j]) for i, j in zip(low.tolist(), high.tolist(), strict=True)),
        margin={name: greatest_lead(place, reached) for place, name in enumerate(STYLE_CLASSES)},
        drives=len(rows),
        too_short=too_short,
    )


def _probe(scene: Scene, *, seed: int, episode: int) -> str | None:
    """A driver who is on the road for 20 s, drawn; None where there is none."""
    tracks = scene.tracks
    long_enough = tracks.valid.sum(axis=1) * tracks.dt_s >= LEAST_S
    able = [i for i in np.flatnonzero(long_enough & tracks.is_motor).tolist() if tracks.driver[i] is not None]
    if not able:
        return None
    return tracks.agent_id[able[int(stream(seed, episode, "", "freedom probe").integers(len(able)))]]


def _measured(scene: Scene, driver: str, judge: TDBM) -> Float64[np.ndarray, " feature"] | None:
    """The scaled features of that driver's whole trip; None if it is too short or one cannot be known."""
    tracks = scene.tracks
    if driver not in tracks.agent_id:
        return None
    agent = tracks.agent_id.index(driver)
    if tracks.valid[agent].sum() * tracks.dt_s < LEAST_S:
        return None
    labels = judge.label_windows(scene, agents=np.array([agent], np.int64))
    scaled = scaled_features(judge, labels)[0]
    return scaled if np.isfinite(scaled).all() else None


def greatest_lead(place: int, box: Float64[np.ndarray, "feature end"]) -> float:
    """The greatest value, over the box, of a class's score minus the best other one: a linear programme."""
    from scipy.optimize import linprog

    difference = np.delete(MATRIX[place] - MATRIX, place, axis=0)  # lead over each other class: difference . (x, 1)
    # Variables x and t; maximise t with t <= difference . (x, 1).
    upper = np.column_stack([-difference[:, :5], np.ones(len(difference))])
    bounds = [*((float(low), float(high)) for low, high in box), (None, None)]
    solved = linprog(np.array([0.0] * 5 + [-1.0]), A_ub=upper, b_ub=difference[:, 5], bounds=bounds, method="highs")
    return float(-solved.fun)
