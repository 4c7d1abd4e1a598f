"""Ways through a network: shortest by free travel time, and where traffic comes in and out."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import count, product
from pathlib import Path
from string import ascii_lowercase

from stylesim.errors import InputError
from stylesim.simulation.sumo.options import Flow
from stylesim.simulation.sumo.roads import RoadNetwork, read_network

MOST_ENTRIES, MOST_WAYS = 60, 30  # chosen, because more flows than that hardly change the traffic, but its set-up time


def edge_of(lane_id: str) -> str:
    """The edge of a lane."""
    return lane_id.rsplit("_", 1)[0]


class WayFinder:
    """The graph of a network's edges; turning round where one came from is no way."""

    def __init__(self, network: RoadNetwork) -> None:
        lanes = {lane.lane_id: lane for lane in network.road.lanes}
        self.ends = network.ends
        self.lanes: dict[str, int] = defaultdict(int)
        self.limit_mps: dict[str, float] = defaultdict(float)
        self._after: dict[str, set[str]] = defaultdict(set)
        self._seconds: dict[str, float] = {}
        for lane in network.road.lanes:
            edge = edge_of(lane.lane_id)
            if edge not in self.ends:
                continue
            self.lanes[edge] += 1
            self.limit_mps[edge] = max(self.limit_mps[edge], lane.speed_limit_mps)
            self._seconds[edge] = network.length_m[lane.lane_id] / max(self.limit_mps[edge], 0.1)
            following, seen = list(lane.successors), set()
            while following:
                name = following.pop()
                if name in seen:
                    continue
                seen.add(name)
                if edge_of(name) in self.ends:
                    if name in lanes and self.ends[edge_of(name)][1] != self.ends[edge][0]:
                        self._after[edge].add(edge_of(name))
                elif name in lanes:
                    following += lanes[name].successors

    def shortest(self, start: str) -> dict[str, str]:
        """For every edge that can be reached from `start`, the edge before it."""
        before, cost, done = {start: ""}, {start: self._seconds.get(start, 0.0)}, set()
        queue = [(cost[start], start)]
        while queue:
            seconds, edge = heapq.heappop(queue)
            if edge in done:
                continue
            done.add(edge)
            for following in sorted(self._after[edge]):
                new = seconds + self._seconds[following]
                if new < cost.get(following, float("inf")):
                    cost[following], before[following] = new, edge
                    heapq.heappush(queue, (new, following))
        return before

    @staticmethod
    def way(before: dict[str, str], goal: str) -> tuple[str, ...]:
        """The edges to `goal`, from the first one on."""
        edges = [goal]
        while before[edges[-1]]:
            edges.append(before[edges[-1]])
        return tuple(reversed(edges))

    def fringe(self) -> tuple[list[str], list[str]]:
        """Edges that begin, and edges that end, at a node with one neighbour only; most important first."""
        neighbours: dict[str, set[str]] = defaultdict(set)
        for one, other in self.ends.values():
            neighbours[one].add(other)
            neighbours[other].add(one)
        mine = [edge for edge in sorted(self.ends) if self.lanes[edge]]
        entries = [edge for edge in mine if neighbours[self.ends[edge][0]] <= {self.ends[edge][1]}]
        exits = [edge for edge in mine if neighbours[self.ends[edge][1]] <= {self.ends[edge][0]}]
        return sorted(entries, key=self._rank), sorted(exits, key=self._rank)

    def weight(self, edge: str) -> float:
        """How much traffic an edge draws: lanes times limit [ours], because capacity grows with both."""
        return self.lanes[edge] * self.limit_mps[edge]

    def _rank(self, edge: str) -> tuple[float, str]:
        return -self.weight(edge), edge


@dataclass(frozen=True)
class GeneratedDemand:
    """Flows between the fringe edges of a network, and what was left out of them."""

    flows: tuple[Flow, ...]
    entry_lanes: int
    left_out: str  # in words, "" where nothing was


@lru_cache(maxsize=8)
def generated_demand(net: Path) -> GeneratedDemand:
    """Traffic from every fringe edge to every other one that it leads to, by the shortest way.

    Shares grow with lanes times limit of both ends. InputError where no two fringe edges are connected.
    """
    finder = WayFinder(read_network(net))
    entries, exits = finder.fringe()
    found: list[tuple[str, dict[str, float]]] = []
    ways_left = 0
    for entry in entries[:MOST_ENTRIES]:
        before = finder.shortest(entry)
        goals = [goal for goal in exits if goal in before and finder.ends[goal][1] != finder.ends[entry][0]]
        ways_left += max(0, len(goals) - MOST_WAYS)
        to = {" ".join(finder.way(before, goal)[1:]): finder.weight(goal) for goal in goals[:MOST_WAYS]}
        if to:
            found.append((entry, to))
    if not found:
        raise InputError(
            f"{net}: none of its {len(entries)} fringe edges leads to another one, so no demand can be generated; "
            "give a route file with --demand"
        )
    total = sum(finder.weight(entry) for entry, _ in found)
    flows = tuple(
        Flow(name=name, enter=entry, share=finder.weight(entry) / total, to=to)
        for name, (entry, to) in zip(_names(), found, strict=False)
    )
    counts = ((len(entries) - len(found), "entries without a flow"), (ways_left, "ways of lesser roads"))
    left_out = ", ".join(f"{n} {what}" for n, what in counts if n)
    return GeneratedDemand(flows, sum(finder.lanes[entry] for entry, _ in found), left_out)


def _names() -> Iterator[str]:
    """Names of flows: f_aa, f_ab ..."""
    for size in count(2):
        for letters in product(ascii_lowercase, repeat=size):
            yield "f_" + "".join(letters)
