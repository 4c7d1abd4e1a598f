"""`SumoBackend`: episodes in SUMO, by libsumo in this process."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from stylesim.population import Population
from stylesim.scenario import Scenario
from stylesim.scene import Scene
from stylesim.simulation.plan import PLAIN, EpisodePlan
from stylesim.simulation.stressors import check_possible, with_events
from stylesim.simulation.sumo.engine import Engine
from stylesim.simulation.sumo.episode import DT_S, EpisodeFiles, prepare_episode, sumo_options
from stylesim.simulation.sumo.flow import FlowSense
from stylesim.simulation.sumo.missing_turns import MissedTurns
from stylesim.simulation.sumo.planned import PlannedEgo
from stylesim.simulation.sumo.recorder import RawLog, Recorder
from stylesim.simulation.sumo.scenes import scene_of
from stylesim.simulation.sumo.stopzone import StopZone
from stylesim.simulation.sumo.stressing import Stressing
from stylesim.simulation.sumo.switching import StyleSwitch
from stylesim.simulation.sumo.yellow import DecisionEvent, YellowController

LEAD_S = 4.0  # recorded before the first logged frame, because bodies follow the path behind them


class SumoBackend:
    """The backend "sumo". libsumo is imported when it is made (MissingDependencyError where it cannot be).

    One simulation per process: a second backend that loads while this one is open gets a SimulationError.
    """

    name = "sumo"

    def __init__(self) -> None:
        self._engine = Engine()

    def run_episode(
        self, scenario: Scenario, population: Population, *, seed: int, episode: int, plan: EpisodePlan = PLAIN
    ) -> Scene:
        """One episode as a scene: the frames after the warm-up, every 0.1 s.

        A vehicle is logged from 3 s after its insertion (it finds its speed and lane until then; the dropped steps are
        counted) until it arrives. Raises InputError, SimulationError.
        """
        with tempfile.TemporaryDirectory(prefix="stylesim-") as folder:
            files = prepare_episode(scenario, population, seed=seed, episode=episode, folder=Path(folder), plan=plan)
            check_possible(plan, files.network.road, scenario.name)
            stressing = Stressing(self._engine.sumo, files)
            ego = PlannedEgo(self._engine.sumo, files, plan.ego, name=scenario.name) if plan.ego else None
            log, decisions = self.simulate(files, stressing, ego)
        scene = with_events(scene_of(log, decisions, files, name=scenario.name), stressing.outcome(), plan)
        return plan.applied_to(scene if ego is None else ego.in_scene(scene))

    def simulate(
        self, files: EpisodeFiles, stressing: Stressing | None = None, ego: PlannedEgo | None = None
    ) -> tuple[RawLog, list[DecisionEvent]]:
        """Steps through a prepared episode; what was logged and what was decided at yellow lights."""
        engine = self._engine
        engine.load(sumo_options(files))
        first = max(0, round((files.warm_up_s - LEAD_S) / DT_S))
        recorder = Recorder(engine.sumo, signals=files.signals, first_step=first)
        yellow, zone = YellowController(engine.sumo, files), StopZone(engine.sumo, files)
        missed = MissedTurns(engine.sumo, files)
        switch, flow = StyleSwitch(engine.sumo, files, yellow), FlowSense(engine.sumo, files)
        if stressing is not None:
            stressing.let_go = yellow.let_go
        for step in range(round(files.end_s / DT_S)):
            switch.before_step(step)
            flow.before_step(step)
            yellow.before_step(step)
            zone.before_step(step)
            missed.before_step(step)
            if stressing is not None:
                stressing.before_step(step)
            if ego is not None and (replaced := ego.before_step(step, () if stressing is None else stressing.walkers)):
                recorder.take_out(replaced)
            engine.step()
            recorder.after_step(step)
            if ego is not None:
                ego.after_step(step)
        return replace(recorder.finish(), missed_turns=tuple(missed.events)), yellow.events

    def close(self) -> None:
        """Ends the simulation."""
        self._engine.close()
