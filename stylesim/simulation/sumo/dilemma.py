"""Drivers who come one by one and meet the onset of yellow at a drawn time before their stop line."""

from __future__ import annotations

from collections.abc import Sequence

from stylesim.errors import InputError
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.sumo.demand import Arrivals, drawn_driver
from stylesim.simulation.sumo.options import Flow, SumoOptions
from stylesim.simulation.sumo.roads import RoadNetwork
from stylesim.simulation.sumo.signals import Programme
from stylesim.simulation.sumo.vehicles import TRUCK_TOP_SPEED_MPS, Driver, Entry
from stylesim.tracks import AgentKind

LEAD_S = 4.0  # from entry to onset; chosen, because the log begins 3 s after the entry and must show the onset


def dilemma_drivers(
    options: SumoOptions,
    network: RoadNetwork,
    programmes: Sequence[Programme],
    population: Population,
    arrivals: Arrivals,
) -> tuple[Driver, ...]:
    """A driver for each lane and yellow of the flows with `onset_tts_s`, at its wished speed from its entry on.

    The road before the stop line must be long enough; InputError says how long.
    """
    drivers: list[Driver] = []
    for flow in options.flows:
        if flow.onset_tts_s is not None:
            times = _onsets(flow, network, programmes, arrivals.until_s)
            lanes = [lane for lane in network.controlled_lanes() if lane.rsplit("_", 1)[0] == flow.enter]
            places = [(time, lane) for time in times for lane in lanes]
            for number, (time, lane) in enumerate(places):
                drivers.append(_driver(flow, number, time, lane, network.length_m[lane], population, arrivals))
    return tuple(drivers)


def _onsets(flow: Flow, network: RoadNetwork, programmes: Sequence[Programme], until_s: float) -> list[float]:
    for programme in programmes:
        links = [link for link in network.links if link.signal == programme.signal]
        mine = [place for place, link in enumerate(links) if link.edge == flow.enter]
        if mine:
            return [time for time in programme.yellow_onsets_s(mine[0], until_s) if time >= LEAD_S]
    raise InputError(f"flow {flow.name!r}: onset_tts_s needs a planned signal at the end of edge {flow.enter!r}")


def _driver(
    flow: Flow, number: int, onset_s: float, lane: str, length_m: float, population: Population, arrivals: Arrivals
) -> Driver:
    driver = drawn_driver(flow, number, round(onset_s - LEAD_S, 1), population, arrivals)
    assert flow.onset_tts_s is not None
    tts_s = float(stream(arrivals.seed, arrivals.episode, driver.driver_id, "onset").uniform(*flow.onset_tts_s))
    speed = arrivals.parameters["speed_limit_mps"] * driver.style.desired_speed_factor
    if driver.kind == AgentKind.TRUCK:
        speed = min(speed, TRUCK_TOP_SPEED_MPS)
    position = length_m - speed * (tts_s + LEAD_S)
    if position < driver.length_m:
        raise InputError(
            f"flow {flow.name!r}: the edge {flow.enter!r} of {length_m:.0f} m is too short for a driver who must enter "
            f"{tts_s + LEAD_S:.1f} s before the stop line at {speed:.1f} m/s; make it {length_m - position + 10:.0f} m"
        )
    entry = Entry(int(lane.rsplit("_", 1)[1]), position, speed)
    return Driver(
        driver.driver_id,
        driver.style,
        driver.kind,
        driver.length_m,
        driver.width_m,
        driver.depart_s,
        driver.route,
        entry=entry,
    )
