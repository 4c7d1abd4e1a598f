"""libsumo behind types of ours: start, load, step; one simulation per process."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, cast, runtime_checkable

from stylesim.errors import MissingDependencyError, SimulationError

SYSTEM_LIBRARIES = "libX11 libXext libXrender libGL libatomic"
DEBIAN_PACKAGES = "libx11-6 libxext6 libxrender1 libgl1 libatomic1"


@runtime_checkable
class Collision(Protocol):
    """One collision that SUMO reports."""

    collider: str
    victim: str


@runtime_checkable
class VehicleApi(Protocol):
    """The part of `libsumo.vehicle` used here."""

    def getIDList(self) -> Sequence[str]: ...  # noqa: D102, N802
    def getIDCount(self) -> int: ...  # noqa: D102, N802
    def getPosition(self, vehID: str) -> tuple[float, float]: ...  # noqa: D102, N802
    def getLateralLanePosition(self, vehID: str) -> float: ...  # noqa: D102, N802
    def getLanePosition(self, vehID: str) -> float: ...  # noqa: D102, N802
    def setLaneChangeMode(self, vehID: str, laneChangeMode: int) -> None: ...  # noqa: D102, N802
    def getAngle(self, vehID: str) -> float: ...  # noqa: D102, N802
    def getNextTLS(self, vehID: str) -> Sequence[tuple[str, int, float, str]]: ...  # noqa: D102, N802
    def getSpeed(self, vehID: str) -> float: ...  # noqa: D102, N802
    def setSpeed(self, vehID: str, speed: float) -> None: ...  # noqa: D102, N802
    def getRoadID(self, vehID: str) -> str: ...  # noqa: D102, N802
    def getSpeedMode(self, vehID: str) -> int: ...  # noqa: D102, N802
    def setSpeedMode(self, vehID: str, sm: int) -> None: ...  # noqa: D102, N802
    def getLaneID(self, vehID: str) -> str: ...  # noqa: D102, N802
    def getRoute(self, vehID: str) -> Sequence[str]: ...  # noqa: D102, N802
    def getRouteIndex(self, vehID: str) -> int: ...  # noqa: D102, N802
    def setRoute(self, vehID: str, edgeList: Sequence[str]) -> None: ...  # noqa: D102, N802
    def setType(self, vehID: str, typeID: str) -> None: ...  # noqa: D102, N802
    def setSpeedFactor(self, vehID: str, factor: float) -> None: ...  # noqa: D102, N802
    def setParameter(self, objectID: str, key: str, value: str) -> None: ...  # noqa: D102, N802


@runtime_checkable
class SimulationApi(Protocol):
    """The part of `libsumo.simulation` used here."""

    def getTime(self) -> float: ...  # noqa: D102, N802
    def getDepartedIDList(self) -> Sequence[str]: ...  # noqa: D102, N802
    def getArrivedIDList(self) -> Sequence[str]: ...  # noqa: D102, N802
    def getCollisions(self) -> Sequence[Collision]: ...  # noqa: D102, N802
    def getStartingTeleportIDList(self) -> Sequence[str]: ...  # noqa: D102, N802
    def getEmergencyStoppingVehiclesIDList(self) -> Sequence[str]: ...  # noqa: D102, N802


@runtime_checkable
class VehicleTypeApi(Protocol):
    """The part of `libsumo.vehicletype` used here."""

    def setParameter(self, objectID: str, param: str, value: str) -> None: ...  # noqa: D102, N802
    def setDecel(self, typeID: str, decel: float) -> None: ...  # noqa: D102, N802


@runtime_checkable
class TrafficLightApi(Protocol):
    """The part of `libsumo.trafficlight` used here."""

    def getRedYellowGreenState(self, tlsID: str) -> str: ...  # noqa: D102, N802
    def getPhase(self, tlsID: str) -> int: ...  # noqa: D102, N802
    def getNextSwitch(self, tlsID: str) -> float: ...  # noqa: D102, N802


@runtime_checkable
class LaneApi(Protocol):
    """The part of `libsumo.lane` used here."""

    def getLastStepVehicleIDs(self, laneID: str) -> Sequence[str]: ...  # noqa: D102, N802
    def getMaxSpeed(self, laneID: str) -> float: ...  # noqa: D102, N802
    def getLinks(self, laneID: str) -> Sequence[tuple[Any, ...]]: ...  # noqa: D102, N802


@runtime_checkable
class SumoApi(Protocol):
    """The part of a running simulation used here, by libsumo or by TraCI."""

    vehicle: VehicleApi
    vehicletype: VehicleTypeApi
    simulation: SimulationApi
    trafficlight: TrafficLightApi
    lane: LaneApi


@runtime_checkable
class SumoModule(SumoApi, Protocol):
    """libsumo itself, which can also start and end a simulation."""

    def start(self, cmd: list[str]) -> Any: ...  # noqa: D102
    def load(self, args: list[str]) -> Any: ...  # noqa: D102
    def simulationStep(self) -> Any: ...  # noqa: D102, N802
    def close(self) -> Any: ...  # noqa: D102


def import_libsumo() -> SumoModule:
    """libsumo; MissingDependencyError with the command that helps where it cannot be imported."""
    os.environ.setdefault("LIBSUMO_AS_TRACI", "quiet")
    try:
        import libsumo
    except ModuleNotFoundError:
        raise MissingDependencyError(
            "libsumo is not installed; install it with: pip install 'stylesim[sumo]'"
        ) from None
    except ImportError as error:
        raise MissingDependencyError(
            f"libsumo cannot be loaded: {error}. It needs the system libraries {SYSTEM_LIBRARIES}; "
            f"on Debian or Ubuntu: apt-get install {DEBIAN_PACKAGES}"
        ) from None
    return cast("SumoModule", libsumo)


class Engine:
    """The one simulation of this process. The first `load` starts it, later ones reuse it."""

    _owner: ClassVar[Engine | None] = None

    def __init__(self) -> None:
        self.sumo = import_libsumo()

    def load(self, options: list[str]) -> None:
        """Loads an episode; SimulationError with SUMO's words where it refuses, or while another engine is open."""
        if Engine._owner not in (None, self):
            raise SimulationError(
                "libsumo allows one simulation per process and another one is open here; close it, "
                "or run this one in a process of its own"
            )
        try:
            if Engine._owner is self:
                self.sumo.load(options)
            else:
                Engine._owner = self
                self.sumo.start(["sumo", *options])
        except Exception as error:
            self.close()
            raise SimulationError(f"SUMO refused the episode: {error}") from error

    def step(self) -> None:
        """One step of 0.1 s; SimulationError with SUMO's words where it fails."""
        try:
            self.sumo.simulationStep()
        except Exception as error:
            self.close()
            raise SimulationError(f"SUMO stopped: {error}") from error

    def close(self) -> None:
        """Ends the simulation; nothing happens where none is open."""
        if Engine._owner is self:
            Engine._owner = None
            self.sumo.close()
