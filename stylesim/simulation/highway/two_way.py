"""A road with one lane each way, where who overtakes drives on the lane of who comes.

As in highway-env's two-way road the lane for overtaking lies on the other direction's own; here both directions
overtake. Its first and last part have no such lane (a solid line), so that nobody enters or leaves while overtaking.
"""

from __future__ import annotations

from collections.abc import Mapping

from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.sites import LANE_M, NONE, SOLID, STRIPED, Site, Trip

SOLID_M = 200.0  # chosen: to see who comes before one may overtake
OPEN_M = 3000.0  # chosen: room for several overtakings, each of 300 to 500 m
PASSING, OWN = 0, 1  # lane numbers, from the left


def two_way_site(drawn: Mapping[str, float]) -> Site:
    """3,400 m straight on, one lane each way; the demand splits evenly between the directions."""
    limit, y = drawn["speed_limit_mps"], LANE_M
    network = RoadNetwork()
    places = (0.0, SOLID_M, SOLID_M + OPEN_M, 2 * SOLID_M + OPEN_M)
    for name, own_y, other_y, xs in (("e", y, 0.0, places), ("w", 0.0, y, places[::-1])):
        for part in range(3):
            edge, ends = (f"{name}{part}", f"{name}{part + 1}"), (xs[part], xs[part + 1])
            if part == 1:
                passing = StraightLane([ends[0], other_y], [ends[1], other_y], line_types=(NONE, NONE))
                passing.speed_limit = limit
                network.add_lane(*edge, passing)
            lines = (STRIPED if part == 1 else SOLID, SOLID)
            own = StraightLane([ends[0], own_y], [ends[1], own_y], line_types=lines, speed_limit=limit)
            network.add_lane(*edge, own)
    trips = tuple(Trip(tuple((f"{name}{n}", f"{name}{n + 1}") for n in range(3))) for name in "ew")
    entries = {trip.edges[0]: drawn["demand_vph"] / 3600.0 / 2 for trip in trips}
    return Site(
        network,
        trips,
        arrivals_per_s=entries,
        filled_m=dict.fromkeys(entries, 1800.0),
        against=frozenset((trip.edges[1][0], trip.edges[1][1], PASSING) for trip in trips),
    )
