"""Makes a vehicle of somebody else's simulation a styled driver's, through libsumo or TraCI, while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from stylesim.plugins.base_types import nearest_base
from stylesim.simulation.sumo.signals import ONSET_S
from stylesim.simulation.sumo.vehicles import Driver, type_attributes
from stylesim.simulation.sumo.yellow import AFTER_YELLOW
from stylesim.style import DriverStyle
from stylesim.styles import style_table
from stylesim.tracks import AgentKind

KINDS = {  # SUMO's vehicle classes; what is not named is OTHER, and gets no style
    **dict.fromkeys(("passenger", "private", "taxi", "evehicle", "hov", "vip", "army", "authority"), AgentKind.CAR),
    **dict.fromkeys(("emergency", "custom1", "custom2", "ignoring"), AgentKind.CAR),
    **dict.fromkeys(("truck", "trailer", "delivery"), AgentKind.TRUCK),
    **dict.fromkeys(("bus", "coach"), AgentKind.BUS),
    **dict.fromkeys(("motorcycle", "moped"), AgentKind.MOTORCYCLE),
    "bicycle": AgentKind.BICYCLE,
    "pedestrian": AgentKind.PEDESTRIAN,
}
STYLED_KINDS = (AgentKind.CAR, AgentKind.TRUCK, AgentKind.BUS, AgentKind.MOTORCYCLE)
SUFFIX = "/styled"  # what the id of a driver's vehicle type ends in

# attribute of a vehicle type -> the method of `vehicletype` that sets it while SUMO runs
SETTERS = {
    "speedFactor": "setSpeedFactor",
    "speedDev": "setSpeedDeviation",
    "tau": "setTau",
    "minGap": "setMinGap",
    "accel": "setAccel",
    "decel": "setDecel",
    "emergencyDecel": "setEmergencyDecel",
    "maxSpeedLat": "setMaxSpeedLat",
}
KEPT = ("length", "width", "maxSpeed", "vClass")  # the user's vehicle stays what it is
OF_BASE = ("carFollowModel", "laneChangeModel", "sigmaerror", "sigmagap", "sigmaleader", "tPersDrive", "jerkmax")


@dataclass(frozen=True)
class Body:
    """A vehicle as the user's type has it."""

    kind: AgentKind
    length_m: float
    width_m: float
    acceleration_mps2: float
    deceleration_mps2: float


def body_of(sumo: Any, name: str) -> Body:
    """What kind of vehicle that is, and how large."""
    vehicle = sumo.vehicle
    return Body(
        KINDS.get(vehicle.getVehicleClass(name), AgentKind.OTHER),
        float(vehicle.getLength(name)),
        float(vehicle.getWidth(name)),
        float(vehicle.getAccel(name)),
        float(vehicle.getDecel(name)),
    )


def fitted(style: DriverStyle, body: Body) -> DriverStyle:
    """The style in a vehicle that is no car: how its driver compares to the neutral one, times what the type can."""
    if body.kind == AgentKind.CAR:
        return style
    neutral = style_table("sumo").at(0.0)
    compared = style.max_acceleration_mps2 / neutral.max_acceleration_mps2
    return replace(
        style,
        max_acceleration_mps2=max(0.1, body.acceleration_mps2 * compared),
        comfortable_deceleration_mps2=max(0.1, min(style.comfortable_deceleration_mps2, body.deceleration_mps2)),
    )


def restyle(sumo: Any, driver: Driver, body: Body, *, known_types: list[str]) -> bool:
    """Give the vehicle a type of its own with the driver's attributes; False where the pedal noise was not carried.

    The type is a copy of the base type with the nearest pedal noise where those were loaded, otherwise of the
    vehicle's own, whose car-following model it keeps. Lane-change attributes and the speed factor are set on the
    vehicle, because `setType` leaves them.
    """
    vehicle, types = sumo.vehicle, sumo.vehicletype
    own, name = vehicle.getTypeID(driver.driver_id), driver.type_id
    base = nearest_base(driver.style.pedal_noise_mps2, known_types)
    types.copy(base or own, name)
    if base:
        _take_body(types, own, name)
    attributes = type_attributes(replace(driver, style=fitted(driver.style, body)))
    if driver.kind == AgentKind.TRUCK:  # `type_attributes` halves it, and a truck's own acceleration was taken already
        attributes["accel"] = f"{fitted(driver.style, body).max_acceleration_mps2:.4f}"
    for attribute, setter in SETTERS.items():
        getattr(types, setter)(name, float(attributes[attribute]))
    for attribute, value in attributes.items():
        if attribute.startswith("jm"):
            types.setParameter(name, f"junctionModel.{attribute}", value)
    types.setParameter(name, AFTER_YELLOW, f"{ONSET_S:.2f}")
    vehicle.setType(driver.driver_id, name)
    vehicle.setSpeedFactor(driver.driver_id, float(attributes["speedFactor"]))
    for attribute, value in attributes.items():
        if attribute.startswith("lc"):
            vehicle.setParameter(driver.driver_id, f"laneChangeModel.{attribute}", value)
    return bool(base)


def _take_body(types: Any, own: str, name: str) -> None:
    """Size, class, colour and top speed of the user's type."""
    what = ("Length", "Width", "Height", "VehicleClass", "EmissionClass", "ShapeClass", "MaxSpeed", "Color", "Mass")
    for attribute in what:
        read: Callable[[str], Any] = getattr(types, f"get{attribute}")
        getattr(types, f"set{attribute}")(name, read(own))
