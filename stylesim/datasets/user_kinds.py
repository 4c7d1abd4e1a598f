"""The many names of kinds of road users."""

from __future__ import annotations

from stylesim.errors import unknown
from stylesim.tracks import AgentKind

_NAMES = {
    AgentKind.CAR: ("car", "vehicle", "van", "auto", "passenger", "passenger car", "taxi", "medium vehicle", "suv"),
    AgentKind.TRUCK: ("truck", "truck_bus", "lorry", "heavy vehicle", "trailer truck"),
    AgentKind.BUS: ("bus", "coach"),
    AgentKind.MOTORCYCLE: ("motorcycle", "motorcyclist", "motorbike", "moped", "scooter", "tricycle"),
    AgentKind.BICYCLE: ("bicycle", "cyclist", "bike", "bicyclist", "biker"),
    AgentKind.PEDESTRIAN: ("pedestrian", "person", "ped"),
    AgentKind.STATIC: ("static", "obstacle"),
    AgentKind.OTHER: ("other", "unknown"),
}
KIND_NAMES = {name: kind for kind, names in _NAMES.items() for name in names}


def kind_of(name: str, *, strict: bool = True) -> AgentKind:
    """The kind that such a name means; InputError (or OTHER, unless `strict`) for one that nobody knows."""
    key = name.strip().lower()
    if key in KIND_NAMES:
        return KIND_NAMES[key]
    if strict:
        raise unknown("kind of road user", name, KIND_NAMES)
    return AgentKind.OTHER
