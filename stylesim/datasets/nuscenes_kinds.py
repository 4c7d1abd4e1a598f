"""The categories of nuScenes, and the car that recorded it."""

from __future__ import annotations

from stylesim.tracks import AgentKind

# A Renault Zoe: 4.084 m long, 1.730 m wide, wheelbase 2.588 m, front overhang 0.839 m by its maker; poses are at the
# middle of the rear axle [read: the data set's paper].
EGO_SIZE_M, EGO_AXLE_TO_CENTRE_M = (4.084, 1.730), 4.084 / 2 - (4.084 - 2.588 - 0.839)
# By prefix, the first that fits.
_KINDS = (
    ("vehicle.car", AgentKind.CAR),
    ("vehicle.emergency.police", AgentKind.CAR),
    ("vehicle.emergency", AgentKind.TRUCK),
    ("vehicle.truck", AgentKind.TRUCK),
    ("vehicle.construction", AgentKind.TRUCK),
    ("vehicle.bus", AgentKind.BUS),
    ("vehicle.motorcycle", AgentKind.MOTORCYCLE),
    ("vehicle.bicycle", AgentKind.BICYCLE),
    ("human.pedestrian", AgentKind.PEDESTRIAN),
    ("movable_object", AgentKind.STATIC),
    ("static_object", AgentKind.STATIC),
)  # trailers, animals and what else there is: OTHER


def kind_of(category: str) -> AgentKind:
    """The kind of road user that a category is."""
    return next((kind for prefix, kind in _KINDS if category.startswith(prefix)), AgentKind.OTHER)
