"""Makes the cars of somebody else's highway-env road ours: the road searches faster, its drivers get styles."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from highway_env.road.regulation import RegulatedRoad
from highway_env.road.road import Road
from highway_env.vehicle.controller import ControlledVehicle

from stylesim.simulation.highway.road import StyledRegulatedRoad, StyledRoad
from stylesim.simulation.highway.traffic import Crew
from stylesim.simulation.highway.vehicle import StyledVehicle

# What a car of another class may have of its own and keeps.
KEPT = ("LENGTH", "WIDTH", "enable_lane_change", "color", "check_collisions", "collidable", "solid", "crashed", "hit")


_STYLED: dict[Any, Any] = {Road: StyledRoad, RegulatedRoad: StyledRegulatedRoad}


def styled_class(kind: Any) -> Any:
    """The same class of road with our searches; made once for each class of a user's."""
    if kind not in _STYLED:
        _STYLED[kind] = type(f"Styled{kind.__name__}", (kind, StyledRoad), {})
    return _STYLED[kind]


def become_styled(road: Any, *, keep: Iterable[Any], crew: Crew) -> None:
    """Give every car that drives by itself, but those of `keep`, a styled driver; who has one already keeps it.

    The road object stays the same and changes its class once, so that everybody's reference to it holds.
    """
    if not isinstance(road, StyledRoad):
        road.__class__ = styled_class(type(road))
        road.prepare()
        for car in road.vehicles:
            car.lane = road.network.get_lane(car.lane_index)
    kept = {id(car) for car in keep}
    changed = [
        car if id(car) in kept or not _drives_itself(car) else _restyled(car, road, crew) for car in road.vehicles
    ]
    road.vehicles[:] = changed


def _drives_itself(car: Any) -> bool:
    """True for who has a policy of its own; parked vehicles have none."""
    return isinstance(car, ControlledVehicle) and getattr(car, "style", None) is None


def _restyled(car: Any, road: Any, crew: Crew) -> StyledVehicle:
    styled: StyledVehicle = StyledVehicle.create_from(car)
    for name in KEPT:
        if hasattr(car, name) and getattr(car, name) != getattr(type(styled), name, None):
            setattr(styled, name, getattr(car, name))
    styled.lane_index, styled.lane = car.lane_index, road.network.get_lane(car.lane_index)
    crew.hire(styled)
    return styled
