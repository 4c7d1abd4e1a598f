"""The log of a populated simulation, and the corpus that it becomes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from stylesim.corpus import Corpus, CorpusWriter
from stylesim.corpus.files import sha256_of
from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.scene import Scene
from stylesim.simulation.sumo.bodies import bodies_of
from stylesim.simulation.sumo.episode import DT_S, Episode
from stylesim.simulation.sumo.recorder import Recorder
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.scenes import SETTLING_S, scene_of
from stylesim.simulation.sumo.vehicles import Driver
from stylesim.simulation.sumo.yellow import DecisionEvent
from stylesim.simulation.workers import with_driver_counts
from stylesim.styles import style_table

SOURCE = "sumo"
SHORTEST_SCENE_S = 1.0  # chosen, because nothing can be labelled or forecast in less


class CrowdLog:
    """Who drives, and where everybody was. `episode` holds the styled drivers; it grows as they come."""

    def __init__(
        self, sumo: Any, population: Population, *, network: RoadNetwork, net: Path, seed: int, rows: bool
    ) -> None:
        self._population, self._net_sha256, self._name = population, sha256_of(net), net.name.split(".")[0]
        drivers: dict[str, Driver] = {}
        self.episode = Episode(
            drivers=drivers,
            now=drivers,
            parameters={},
            network=network,
            seed=seed,
            episode=0,
            warm_up_s=0.0,
            duration_s=0.0,
            pedal_by_sumo=True,
        )
        self._styled = drivers
        self._everybody: dict[str, Driver] = {}
        signals = network.signals()
        self._recorder = Recorder(sumo, signals=signals, first_step=0) if rows else None

    def take_in(self, names: Sequence[str]) -> None:
        """Vehicles that were on the road before; they have settled."""
        if self._recorder is not None:
            self._recorder.take_in(names, -round(SETTLING_S / DT_S))

    def welcome(self, driver: Driver, *, styled: bool) -> None:
        """Somebody is there; who is not styled is logged without a driver, and does not wander."""
        if styled:
            self._styled[driver.driver_id] = driver
        else:
            driver = replace(driver, style=replace(style_table().at(0.0), lane_wander_m=0.0))
        self._everybody[driver.driver_id] = driver

    def after_step(self, step: int) -> None:
        """Record a step."""
        if self._recorder is not None:
            self._recorder.after_step(step)

    def save(
        self,
        out: Path,
        *,
        decisions: list[DecisionEvent],
        steps: int,
        name: str,
        scene_s: float,
        begin_s: float,
        counts: Mapping[str, int],
    ) -> Corpus:
        """The corpus of the first `steps` steps, in scenes of `scene_s` seconds."""
        if self._recorder is None:
            raise InputError("nothing was logged: populate(…, log=False)")
        if not scene_s >= SHORTEST_SCENE_S:
            raise InputError(f"scene_s must be at least {SHORTEST_SCENE_S:g}, not {scene_s}")
        cuts = _cuts(steps, round(scene_s / DT_S))
        if not cuts:
            raise InputError(f"{steps} steps of 0.1 s were driven; a scene takes {SHORTEST_SCENE_S:g} s at least")
        name = name or self._name
        writer = CorpusWriter(
            out, source=SOURCE, seed=self.episode.seed, configuration=self._configuration(name, scene_s)
        )
        with writer:
            for scene in self._scenes(cuts, decisions, name=name, begin_s=begin_s):
                writer.add(scene)
            return writer.finish(counts={**counts, "steps_dropped_at_the_end": steps - cuts[-1].stop})

    def _scenes(
        self, cuts: Sequence[range], decisions: list[DecisionEvent], *, name: str, begin_s: float
    ) -> list[Scene]:
        assert self._recorder is not None
        log = self._recorder.finish()
        episode = replace(self.episode, drivers=self._everybody, now=self._everybody)
        bodies = bodies_of(log, episode)
        unit = f"{name}-{self.episode.seed}"
        scenes = []
        for number, cut in enumerate(cuts):
            part = replace(episode, warm_up_s=cut.start * DT_S, duration_s=len(cut) * DT_S)
            scene = scene_of(log, decisions, part, name=name, bodies=bodies)
            driver = tuple(
                style if agent in self._styled else None
                for agent, style in zip(scene.tracks.agent_id, scene.tracks.driver, strict=True)
            )
            scenes.append(
                with_driver_counts(
                    replace(
                        scene,
                        scene_id=f"{unit}-{number:04d}",
                        unit_id=unit,
                        source_scenario_id=f"{unit}-{number:04d}",
                        start_s=round(begin_s + cut.start * DT_S, 1),
                        tracks=replace(scene.tracks, driver=driver),
                        counts={key: n for key, n in scene.counts.items() if key not in ("drivers", "not_inserted")},
                    )
                )
            )
        return scenes

    def _configuration(self, name: str, scene_s: float) -> dict[str, Any]:
        """What the corpus depends on, without any path."""
        try:
            simulators = {"libsumo": version("libsumo")}
        except PackageNotFoundError:
            simulators = {}
        population = {**asdict(self._population), "shares": list(self._population.shares)}
        return {
            "populated": name,
            "population": population,
            "net_sha256": self._net_sha256,
            "scene_s": scene_s,
            "simulators": simulators,
        }


def _cuts(steps: int, length: int) -> list[range]:
    """The scenes' steps; a last one that is too short is left out."""
    ranges = [range(start, min(start + length, steps)) for start in range(0, steps, length)]
    return [item for item in ranges if len(item) >= round(SHORTEST_SCENE_S / DT_S)]
