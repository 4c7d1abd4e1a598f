"""`HighwayBackend`: one episode of a highway-env scenario as a `Scene`."""

from __future__ import annotations

import numpy as np

from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.scene import Scene
from stylesim.simulation.highway.lanes import road_of
from stylesim.simulation.highway.layouts import traffic_of
from stylesim.simulation.highway.log import TrackLog
from stylesim.simulation.highway.planned import PlannedEgo
from stylesim.simulation.highway.spec import LOG_HZ, options_of
from stylesim.simulation.highway.stressing import Stressing
from stylesim.simulation.highway.traffic import Crew, Traffic
from stylesim.simulation.plan import PLAIN, EpisodePlan
from stylesim.simulation.stressors import attempts, check_possible, with_events
from stylesim.tracks import TrackFlag, Tracks

SOURCE = "highway_env"
AT_LIGHTS = (
    ("decided_stop", TrackFlag.DECIDED_STOP),
    ("decided_go", TrackFlag.DECIDED_GO),
    ("stopped_at_line", TrackFlag.STOPPED_AT_LINE),
    ("crossed_on_yellow", TrackFlag.CROSSED_ON_YELLOW),
    ("ran_red", TrackFlag.RAN_RED),
)


class HighwayBackend:
    """Runs scenarios of every layout of `spec`; holds nothing between episodes."""

    name = "highway"

    def prepare(self, scenario: Scenario) -> None:
        """Check that the scenario can be run; InputError naming file and key if not."""
        options_of(scenario)

    def run_episode(
        self, scenario: Scenario, population: Population, *, seed: int, episode: int, plan: EpisodePlan = PLAIN
    ) -> Scene:
        """One episode at 10 Hz; the same arguments give the same scene. InputError for options that do not fit."""
        options = options_of(scenario)
        drawn = scenario.draw(stream(seed, episode, "", "parameters"))
        crew = Crew(population, seed=seed, episode=episode, twin=plan.twin)
        traffic = traffic_of(options, drawn, crew, time_s=scenario.warm_up_s + scenario.duration_s)
        road = road_of(traffic.road.network, junction_nodes=traffic.junction_nodes, against=traffic.road.graph.against)
        check_possible(plan, road, scenario.name)
        tries = attempts(plan, seed=seed, episode=episode, duration_s=scenario.duration_s)
        stressing = Stressing(traffic, crew, road, list(tries))
        n_frames = round(scenario.duration_s * LOG_HZ)
        log = TrackLog(n_frames, 1.0 / LOG_HZ)
        for _ in range(round(scenario.warm_up_s * options.simulation_hz)):
            traffic.advance()
        early = len(traffic.removed)
        traffic.start_log()
        ego = PlannedEgo(traffic, plan.ego, name=scenario.name, seed=seed, episode=episode) if plan.ego else None
        for frame in range(n_frames):
            if ego is not None:
                ego.before_frame()
            log.add(traffic.frame())
            if ego is not None:
                ego.after_frame()
            crew.after_frame(frame / LOG_HZ, traffic.road.vehicles)
            stressing.after_frame(frame / LOG_HZ)
            for _ in range(options.simulation_hz // LOG_HZ):
                traffic.advance()
        tracks = log.tracks(set(traffic.removed), traffic.flags())
        scene_id = f"{scenario.name}-{seed}-{episode:05d}"
        scene = Scene(
            scene_id=scene_id,
            unit_id=scene_id,
            source=SOURCE,
            scenario=scenario.name,
            tracks=tracks,
            road=road,
            signals=traffic.signals(),
            counts=_counts(tracks, traffic, log, removed_before_log=early),
            parameters=drawn,
        )
        scene = scene if ego is None else ego.in_scene(scene)
        return plan.applied_to(with_events(scene, stressing.outcome(), plan))

    def close(self) -> None:
        """Nothing is held."""


def _counts(tracks: Tracks, traffic: Traffic, log: TrackLog, *, removed_before_log: int) -> dict[str, int]:
    """What happened, as whole numbers; `collisions` are pairs that touched, the others are cars."""
    reasons = traffic.removals()
    logged = set(log.vehicles)
    return {
        "collisions": sum(bool(pair & logged) for pair in traffic.road.collided_pairs),
        "collided": int(np.count_nonzero(tracks.flagged(TrackFlag.COLLIDED))),
        "emergency_braked": int(np.count_nonzero(tracks.flagged(TrackFlag.EMERGENCY_BRAKED))),
        **({} if traffic.signals() is None else {n: int(tracks.flagged(f).sum()) for n, f in AT_LIGHTS}),
        "removed_crashed": reasons["crashed"],
        "removed_off_road": reasons["off_road"],
        "removed_before_log": removed_before_log,
        **{name: int(number) for name, number in sorted(traffic.counts.items())},
    }
