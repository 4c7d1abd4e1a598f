"""Who comes when: arrivals at the entries of a site, or single cars about the onsets of yellow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stylesim.simulation.highway.graph import LaneIndex
from stylesim.simulation.highway.lane_choice import Needs
from stylesim.simulation.highway.lights import Lights
from stylesim.simulation.highway.sites import Edge, Trip

SHORTEST_HEADWAY_S = 1.0  # between two arrivals in one lane; chosen: bold drivers follow so closely
LEAST_SHARE = 0.8  # of the mean headway, at most, is the shortest one
LEAD_S = 4.0  # single cars are placed that long before the onset of yellow, so that they are logged for 1 s before it
DILEMMA_S = (1.0, 6.0)  # REFERENCE section 5: who is nearer goes, who is farther stops


@dataclass(frozen=True, eq=False)
class Way:
    """A trip, with the lane changes that it asks for."""

    trip: Trip
    needs: Needs

    def route(self) -> list[Any]:
        """A route in highway-env's terms, of its own."""
        return [(*edge, None) for edge in self.trip.edges]


def draw_way(ways: Sequence[Way], edge: Edge, rng: np.random.Generator) -> int:
    """The number of one of the ways that begin at this road, by their shares."""
    fitting = [number for number, way in enumerate(ways) if way.trip.edges[0] == edge]
    shares = np.array([ways[number].trip.share for number in fitting])
    return int(fitting[int(rng.choice(len(fitting), p=shares / shares.sum()))])


def arrivals(
    per_s: Mapping[Edge, float],
    ways: Sequence[Way],
    beside: Mapping[Edge, int],
    *,
    rng: np.random.Generator,
    until_s: float,
) -> list[tuple[float, Edge, int]]:
    """(time, entry, way) of every arrival, latest first: exponential headways above a shortest one."""
    due = []
    for edge, rate in sorted(per_s.items()):
        if rate <= 0:
            continue
        least = min(SHORTEST_HEADWAY_S / beside[edge], LEAST_SHARE / rate)
        time = least + rng.exponential(1.0 / rate - least)
        while time <= until_s:
            due.append((time, edge, draw_way(ways, edge, rng)))
            time += least + rng.exponential(1.0 / rate - least)
    return sorted(due, reverse=True)


def dilemmas(lights: Lights, *, rng: np.random.Generator, until_s: float) -> list[tuple[float, LaneIndex, float]]:
    """(time of insertion, lane, time to the line at the onset of yellow) of single cars, latest first."""
    onsets = [onset - LEAD_S for onset in lights.programme.onsets_of_yellow(until_s) if onset >= LEAD_S]
    placed = [(time, index, float(rng.uniform(*DILEMMA_S))) for time in onsets for index in lights.lanes]
    return sorted(placed, reverse=True)
