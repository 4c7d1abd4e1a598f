"""`populate`: styled drivers in a user's own SUMO simulation, run by libsumo or TraCI."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from stylesim.corpus import Corpus
from stylesim.errors import InputError, SimulationError
from stylesim.plugins.connection import check_options, connected, network_of, network_path
from stylesim.plugins.crowd_log import CrowdLog
from stylesim.plugins.restyle import STYLED_KINDS, SUFFIX, body_of, restyle
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.flow import FlowSense
from stylesim.simulation.sumo.roads import read_network
from stylesim.simulation.sumo.stopzone import StopZone
from stylesim.simulation.sumo.vehicles import Driver
from stylesim.simulation.sumo.yellow import YellowController
from stylesim.style import DriverStyle
from stylesim.styles import style_table
from stylesim.tracks import AgentKind

SUMO_OPTIONS = (
    "--step-length", "0.1", "--lanechange.duration", "4.5", "--tls.yellow.min-decel", "7.5",
    "--collision.action", "warn", "--collision.check-junctions", "--time-to-teleport", "-1",
)  # fmt: skip


def populate(
    connection: Any,
    population: Population | str,
    seed: int,
    *,
    net: str | Path | None = None,
    only: Callable[[str], bool] | None = None,
    log: bool = True,
    solid_line: bool = True,
) -> StyledCrowd:
    """Give every vehicle that departs in a running simulation a driver of the population.

    `connection` is the module libsumo or traci, or a `traci` connection, started with `SUMO_OPTIONS` (at least the
    first two). Call `step()` of what is returned after every `simulationStep()`, or `listen()` once. `net` is the
    network's file where the one that the simulation names cannot be read from here; `only(vehicle_id)` False leaves a
    vehicle as it is; with `log=False` nothing is kept for `save`; with `solid_line` drivers do not change lanes for
    speed in the last 80 m before a light.

    Raises InputError where the simulation is not running, or its options or network do not fit.
    """
    crowd = Population.load(population) if isinstance(population, str) else population
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed must be a whole number of at least 0, not {seed!r}")
    sumo = connected(connection)
    check_options(sumo)
    return StyledCrowd(sumo, crowd, seed=seed, net=network_path(sumo, net), only=only, log=log, solid_line=solid_line)


class StyledCrowd:
    """The styled drivers of a simulation that the user steps; made by `populate`."""

    def __init__(
        self,
        sumo: Any,
        population: Population,
        *,
        seed: int,
        net: Path,
        only: Callable[[str], bool] | None,
        log: bool,
        solid_line: bool,
    ) -> None:
        self._sumo = sumo
        self._population, self._seed, self._only = population, seed, only
        self._network = network_of(sumo, net, read_network)
        self._known_types = list(sumo.vehicletype.getIDList())
        self._begin_s = float(sumo.simulation.getTime())
        self._steps = 0
        self._pedals_not_carried = 0
        self._log = CrowdLog(sumo, population, network=self._network, net=net, seed=seed, rows=log)
        self._yellow = YellowController(sumo, self._log.episode)
        self._flow = FlowSense(sumo, self._log.episode)
        self._zone = StopZone(sumo, self._log.episode) if solid_line else None
        already = list(sumo.vehicle.getIDList())
        self._log.take_in(already)
        for name in already:
            self._welcome(name)
        self._before_step()

    @property
    def styles(self) -> Mapping[str, DriverStyle]:
        """Vehicle id -> its driver, of everybody who got one so far, also of those who have left."""
        return MappingProxyType({name: driver.style for name, driver in self._log.episode.now.items()})

    def step(self) -> None:
        """Take in one step of the simulation; to be called once after each `simulationStep()`.

        SimulationError where the simulation's clock shows that steps were left out.
        """
        self._steps += 1
        time_s, expected_s = float(self._sumo.simulation.getTime()), self._begin_s + self._steps * DT_S
        if abs(time_s - expected_s) > DT_S / 2:
            raise SimulationError(
                f"the simulation is at {time_s:.2f} s and the crowd at {expected_s:.2f} s: "
                "call step() once after each simulationStep() of 0.1 s"
            )
        self._log.after_step(self._steps - 1)
        for name in self._sumo.simulation.getDepartedIDList():
            self._welcome(name)
        self._before_step()

    def listen(self) -> None:
        """Let the connection call `step` after each `simulationStep()`, until this simulation ends.

        InputError where the connection has no step listeners.
        """
        if not hasattr(self._sumo, "addStepListener"):
            raise InputError("this connection has no step listeners; call step() after each simulationStep()")
        from traci.step import StepListener  # libsumo's listeners are of this class, too

        class Listener(StepListener):  # type: ignore[misc]
            """Passes steps on."""

            def step(listener, t: float = 0.0) -> bool:  # noqa: N805 - `self` is the crowd
                """After each step; True to stay, False in another simulation that was started since."""
                if float(self._sumo.simulation.getTime()) < self._begin_s + (self._steps + 0.5) * DT_S:
                    return False
                self.step()
                return True

        self._sumo.addStepListener(Listener())

    def save(self, out: str | Path, *, name: str = "", scene_s: float = 60.0) -> Corpus:
        """What was driven so far as a new corpus of scenes of `scene_s` seconds; `name` is the scenario's.

        The first 3 s of each vehicle are not logged, nor is a rest at the end that is shorter than 1 s; both are
        counted. Raises InputError if `out` exists or nothing was logged, CorpusError where the disk refuses.
        """
        return self._log.save(
            Path(out),
            decisions=self._yellow.events,
            steps=self._steps,
            name=name,
            scene_s=scene_s,
            begin_s=self._begin_s,
            counts={"pedal_noise_not_carried": self._pedals_not_carried},
        )

    def _before_step(self) -> None:
        self._flow.before_step(self._steps)
        self._yellow.before_step(self._steps)
        if self._zone is not None:
            self._zone.before_step(self._steps)

    def _welcome(self, name: str) -> None:
        """A vehicle that has just departed gets its driver, if it is one that has a driver at all."""
        if name not in self._sumo.vehicle.getIDList():  # it has left in the same step
            self._log.welcome(Driver(name, style_table().at(0.0), AgentKind.OTHER, 5.0, 1.8, 0.0, ""), styled=False)
            return
        body = body_of(self._sumo, name)
        limit = float(self._sumo.lane.getMaxSpeed(self._sumo.vehicle.getLaneID(name)))
        style = self._population.draw(stream(self._seed, 0, name, "style"), backend="sumo", limit_mps=limit)
        driver = Driver(name, style, body.kind, body.length_m, body.width_m, 0.0, "", SUFFIX)
        styled = body.kind in STYLED_KINDS and (self._only is None or self._only(name))
        self._log.welcome(driver, styled=styled)
        if styled and not restyle(self._sumo, driver, body, known_types=self._known_types):
            if not self._pedals_not_carried:
                warnings.warn(
                    "the pedal noise of the styles is not carried by your vehicle types; load a file made by "
                    "`stylesim export sumo-vtypes` (sumo -a FILE) for drivers as in `stylesim generate`",
                    stacklevel=4,
                )
            self._pedals_not_carried += 1
