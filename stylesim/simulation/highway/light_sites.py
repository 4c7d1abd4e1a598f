"""Roads that lead to a light: two lanes of traffic, or single roads for drivers who meet the yellow alone."""

from __future__ import annotations

from collections.abc import Mapping

from highway_env.road.lane import StraightLane
from highway_env.road.road import RoadNetwork

from stylesim.simulation.highway.lights import Programme
from stylesim.simulation.highway.sites import SOLID, Site, Trip, lanes_beside

LINE_M, ACROSS_M = 400.0, 20.0  # chosen: a driver decides within 250 m; a crossing of two lanes each way
BEYOND_M = 150.0
DILEMMA_ROADS = 10  # chosen: what a step costs is then shared by ten drivers
DILEMMA_APART_M = 12.0  # chosen: nobody sees a road beside as its own, or is in the way from there
DILEMMA_BEYOND_M = 40.0  # over the line everything is decided


def _programme(drawn: Mapping[str, float]) -> Programme:
    return Programme(drawn["green_s"], drawn["yellow_s"], drawn["red_s"])


def yellow_light_site(drawn: Mapping[str, float]) -> Site:
    """400 m of two lanes to a signal, 20 m of crossing, 150 m beyond."""
    limit, across = drawn["speed_limit_mps"], LINE_M + ACROSS_M
    network = RoadNetwork()
    through = (("west", "iw"), ("iw", "ie"), ("ie", "east"))
    for edge, span in zip(through, ((0.0, LINE_M), (LINE_M, across), (across, across + BEYOND_M)), strict=True):
        lanes_beside(network, edge, span, lanes=2, limit_mps=limit)
    return Site(
        network,
        (Trip(through),),
        arrivals_per_s={through[0]: drawn["demand_vph"] / 3600.0},
        filled_m={through[0]: 250.0},
        junction_nodes="i",
        light=_programme(drawn),
    )


def dilemma_site(drawn: Mapping[str, float]) -> Site:
    """Ten roads of one lane to the same light: nobody can change lanes, so everybody meets the yellow without a leader.

    Without arrivals: the dilemma places its cars itself.
    """
    limit, across = drawn["speed_limit_mps"], LINE_M + ACROSS_M
    network, trips = RoadNetwork(), []
    for road in range(DILEMMA_ROADS):
        through = ((f"west{road}", f"iw{road}"), (f"iw{road}", f"ie{road}"), (f"ie{road}", f"east{road}"))
        y = road * DILEMMA_APART_M
        spans = ((0.0, LINE_M), (LINE_M, across), (across, across + DILEMMA_BEYOND_M))
        for edge, (start, end) in zip(through, spans, strict=True):
            lane = StraightLane([start, y], [end, y], line_types=(SOLID, SOLID), speed_limit=limit)
            network.add_lane(*edge, lane)
        trips.append(Trip(through))
    return Site(network, tuple(trips), {}, {}, junction_nodes="i", light=_programme(drawn))
