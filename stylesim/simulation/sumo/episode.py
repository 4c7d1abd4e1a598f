"""One episode as files that the bare `sumo` program can run too: network, routes, signal programme, options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.scenario import Scenario
from stylesim.simulation.driving import HARDEST_BRAKING_MPS2
from stylesim.simulation.plan import PLAIN, EpisodePlan, Twin, salted
from stylesim.simulation.sumo.demand import Arrivals, check_routes, draw_drivers, routes_xml
from stylesim.simulation.sumo.demanded import demanded_drivers
from stylesim.simulation.sumo.dilemma import dilemma_drivers
from stylesim.simulation.sumo.network import compiled_network
from stylesim.simulation.sumo.options import SumoOptions, sumo_options_of
from stylesim.simulation.sumo.roads import RoadNetwork, read_network
from stylesim.simulation.sumo.signals import Programme, programme_of, programmes_xml
from stylesim.simulation.sumo.vehicles import Driver
from stylesim.simulation.sumo.ways import WayFinder, generated_demand

DT_S = 0.1
TWIN_TYPE = "/twin"  # what the id of a driver's second vehicle type ends in


@dataclass(frozen=True, kw_only=True)
class Episode:
    """Who drives where and when in one episode: what decisions, tracks and flags depend on, wherever SUMO runs."""

    drivers: Mapping[str, Driver]
    parameters: Mapping[str, float]
    network: RoadNetwork
    seed: int
    episode: int
    warm_up_s: float
    duration_s: float
    twin: Twin | None = None
    pedal_by_sumo: bool = False  # EIDM's error terms carry the pedal noise, so that the log adds none
    now: dict[str, Driver] = field(default_factory=dict)  # the drivers as they are at the moment; `drivers`: at first

    @property
    def switch_step(self) -> int:
        """The first simulation step in which the twin's driver may differ; -1 where none changes on the way."""
        if self.twin is None or self.twin.at_s is None:
            return -1
        return round((self.warm_up_s + self.twin.at_s) / DT_S) + 1

    def stream(self, driver_id: str, purpose: str, *, step: int = 0) -> np.random.Generator:
        """The driver's random stream for that purpose, from that step on (a null twin's is another one)."""
        twin = self.twin
        other = twin is not None and twin.new_noise and twin.driver == driver_id and step >= self.switch_step
        return stream(self.seed, self.episode, driver_id, salted(purpose, new_noise=other))

    @property
    def signals(self) -> tuple[str, ...]:
        """The traffic lights of the network, sorted."""
        return self.network.signals()

    @property
    def end_s(self) -> float:
        """When the episode ends on SUMO's clock."""
        return self.warm_up_s + self.duration_s


@dataclass(frozen=True, kw_only=True)
class EpisodeFiles(Episode):
    """Everything that decides how an episode runs, but for the drivers' answers to yellow lights."""

    network_path: Path
    route_path: Path
    additional_path: Path | None  # the signal programmes, where the scenario has plans for signals
    options: SumoOptions
    plan: EpisodePlan = PLAIN


def prepare_episode(
    scenario: Scenario, population: Population, *, seed: int, episode: int, folder: Path, plan: EpisodePlan = PLAIN
) -> EpisodeFiles:
    """Draws an episode and writes its files into `folder` (which exists).

    Raises InputError for options that do not fit, SimulationError where the network cannot be compiled.
    """
    options = sumo_options_of(scenario)
    parameters = scenario.draw(stream(seed, episode, "", "scenario"))
    if options.own is None:
        path = compiled_network(scenario, options, speed_limit_mps=parameters["speed_limit_mps"])
    else:
        path = scenario.folder / options.own.net
        if not options.flows and not options.own.demand:
            options = options.model_copy(update={"flows": generated_demand(path).flows})
    network = read_network(path)
    check_routes(options, network, name=scenario.name)
    programmes = _programmes(options, network, parameters, seed=seed, episode=episode)
    until_s = scenario.warm_up_s + scenario.duration_s * options.last_entry_share
    limits = {} if options.own is None else WayFinder(network).limit_mps
    arrivals = Arrivals(seed, episode, until_s, parameters, limits)
    drivers = draw_drivers(options, population, arrivals)
    if options.own is not None and options.own.demand:
        drivers += demanded_drivers(scenario.folder / options.own.demand, network, population, arrivals)
    drivers += dilemma_drivers(options, network, programmes, population, arrivals)
    drivers = tuple(sorted(drivers, key=lambda driver: (driver.depart_s, driver.driver_id)))
    routes = folder / "routes.rou.xml"
    drivers, others = _with_twin(drivers, plan.twin)
    routes.write_text(routes_xml(drivers, others), encoding="utf-8")
    additional = None
    if programmes:
        additional = folder / "signals.add.xml"
        additional.write_text(programmes_xml(programmes), encoding="utf-8")
    return EpisodeFiles(
        network_path=path,
        route_path=routes,
        additional_path=additional,
        drivers={driver.driver_id: driver for driver in drivers},
        parameters=parameters,
        network=network,
        options=options,
        seed=seed,
        episode=episode,
        warm_up_s=scenario.warm_up_s,
        duration_s=scenario.duration_s,
        twin=plan.twin,
        plan=plan,
        now={driver.driver_id: driver for driver in drivers},
    )


def _programmes(
    options: SumoOptions, network: RoadNetwork, parameters: Mapping[str, float], *, seed: int, episode: int
) -> list[Programme]:
    """The programmes of the signals that the scenario plans; they share where in the cycle the episode begins."""
    share = float(stream(seed, episode, "", "signal offset").random())
    return [programme_of(plan, network, parameters, offset_share=share) for plan in options.signals]


def _with_twin(drivers: tuple[Driver, ...], twin: Twin | None) -> tuple[tuple[Driver, ...], tuple[Driver, ...]]:
    """The drivers as they enter, and who one of them will become on the way (`switching.StyleSwitch`)."""
    chosen = [driver for driver in drivers if twin is not None and driver.driver_id == twin.driver]
    if twin is None:
        return drivers, ()
    if not chosen:
        raise InputError(f"the twin's driver {twin.driver!r} does not exist in this episode")
    other = replace(chosen[0], style=twin.style)
    if twin.at_s is None:
        return tuple(other if driver is chosen[0] else driver for driver in drivers), ()
    return drivers, (replace(other, type_suffix=TWIN_TYPE),)


def sumo_options(files: EpisodeFiles) -> list[str]:
    """The command line (without the program) of the episode, for libsumo and for the bare `sumo` alike.

    Collisions are warned of and not removed, nobody is teleported. Lane changes take time: `maxSpeedLat` of each
    type gives it, the option switches it on. A driver may brake at a yellow with up to 7.5 m/s2, because whether it
    does is decided in `driving`.
    """
    seed = (files.seed * 1_000_003 + files.episode) % (2**31 - 1)
    options = ["-n", str(files.network_path), "-r", str(files.route_path)]
    if files.additional_path is not None:
        options += ["-a", str(files.additional_path)]
    options += ["--seed", str(seed), "--step-length", f"{DT_S}", "--begin", "0", "--end", f"{files.end_s:.1f}"]
    options += ["--collision.action", "warn", "--collision.check-junctions", "--time-to-teleport", "-1"]
    options += ["--lanechange.duration", "4.5", "--tls.yellow.min-decel", f"{HARDEST_BRAKING_MPS2}"]
    return [*options, "--no-step-log", "--no-warnings", "--duration-log.disable", "--xml-validation", "never"]
