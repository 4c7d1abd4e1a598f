"""A user's connection to SUMO, looked at before anything is changed in it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from stylesim.errors import InputError
from stylesim.simulation.driving import HARDEST_BRAKING_MPS2
from stylesim.simulation.sumo.episode import DT_S
from stylesim.simulation.sumo.roads import RoadNetwork

DOMAINS = ("simulation", "vehicle", "vehicletype", "trafficlight", "lane")


def connected(connection: Any) -> Any:
    """The connection; InputError if it is none, or no simulation runs in it."""
    missing = [name for name in DOMAINS if not hasattr(connection, name)]
    if missing:
        raise InputError(
            f"the connection has no {', '.join(missing)}: give the module libsumo or traci after its start(), "
            "or a traci connection"
        )
    try:
        connection.simulation.getTime()
        connection.vehicle.getIDList()
    except Exception as error:  # libsumo and traci raise classes of their own, which need not be installed
        raise InputError(f"no simulation runs in this connection ({error}); start it first") from error
    return connection


def check_options(sumo: Any) -> None:
    """InputError for options with which styles cannot be driven or logged; a warning for one that bends them."""
    step_s = float(sumo.simulation.getDeltaT())
    if abs(step_s - DT_S) > 1e-6:
        raise InputError(
            f"the simulation makes steps of {step_s:g} s; populate needs --step-length 0.1 (see stylesim.SUMO_OPTIONS)"
        )
    if _number(sumo, "lanechange.duration") <= 0 and _number(sumo, "lateral-resolution") <= 0:
        raise InputError(
            "lane changes are jumps of one step in this simulation; populate needs --lanechange.duration 4.5 "
            "(or the sublane model; see stylesim.SUMO_OPTIONS)"
        )
    if _number(sumo, "tls.yellow.min-decel") < HARDEST_BRAKING_MPS2:
        warnings.warn(
            f"without --tls.yellow.min-decel {HARDEST_BRAKING_MPS2} SUMO lets drivers who decide late to stop go on "
            "at a yellow (see stylesim.SUMO_OPTIONS)",
            stacklevel=3,
        )


def _number(sumo: Any, option: str) -> float:
    try:
        return float(sumo.simulation.getOption(option))
    except ValueError:  # a multiple of something, or not set
        return 0.0


def network_path(sumo: Any, net: str | Path | None) -> Path:
    """The file of the simulation's network; InputError if it cannot be found from here."""
    path = Path(net if net is not None else sumo.simulation.getOption("net-file"))
    if not path.is_file():
        raise InputError(f"the network of the simulation is not at {path}; say where it is with net=…")
    if path.suffix == ".gz":
        raise InputError(f"{path} is compressed; unpack it and give the file with net=…")
    return path


def network_of(sumo: Any, path: Path, read: Callable[[Path], RoadNetwork]) -> RoadNetwork:
    """The network, read; InputError naming the file where it is none, or another simulation's."""
    try:
        network = read(path)
    except (ParseError, KeyError, ValueError, IndexError) as error:
        raise InputError(f"{path} is no SUMO network that can be read: {type(error).__name__}: {error}") from error
    lanes = {lane.lane_id for lane in network.road.lanes}
    if not lanes or not lanes <= set(sumo.lane.getIDList()):
        raise InputError(f"{path} is not the network of this simulation; say where that is with net=…")
    return network
