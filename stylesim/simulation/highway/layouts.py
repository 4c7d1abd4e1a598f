"""Which traffic a scenario's layout asks for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from stylesim.simulation.highway.junction import JunctionTraffic
from stylesim.simulation.highway.light_sites import dilemma_site, yellow_light_site
from stylesim.simulation.highway.open_traffic import OpenTraffic
from stylesim.simulation.highway.roundabout import roundabout_site
from stylesim.simulation.highway.sites import Site, exit_site, merge_site
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.traffic import Crew, Traffic, highway_traffic
from stylesim.simulation.highway.two_way import two_way_site

SITES: dict[str, Callable[[Mapping[str, float]], Site]] = {
    "merge": merge_site,
    "exit": exit_site,
    "roundabout": roundabout_site,
    "two_way": two_way_site,
    "yellow_light": yellow_light_site,
}


def traffic_of(options: HighwayOptions, drawn: Mapping[str, float], crew: Crew, *, time_s: float) -> Traffic:
    """The traffic that the scenario's layout asks for, at its first moment; `time_s` is how long it must last."""
    if options.layout == "highway":
        return highway_traffic(options, drawn, crew, time_s=time_s)
    if options.layout == "intersection":
        return JunctionTraffic(options, drawn, crew)
    dilemma = options.layout == "yellow_light" and options.arrivals == "dilemma"
    site = dilemma_site(drawn) if dilemma else SITES[options.layout](drawn)
    return OpenTraffic(site, options, crew, time_s=time_s)
