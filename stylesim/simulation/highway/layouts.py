"""Which traffic a scenario's layout asks for."""

from __future__ import annotations

from collections.abc import Mapping

from stylesim.simulation.highway.junction import JunctionTraffic
from stylesim.simulation.highway.open_traffic import OpenTraffic
from stylesim.simulation.highway.roundabout import roundabout_site
from stylesim.simulation.highway.sites import SITES
from stylesim.simulation.highway.spec import HighwayOptions
from stylesim.simulation.highway.traffic import Crew, Traffic, highway_traffic


def traffic_of(options: HighwayOptions, drawn: Mapping[str, float], crew: Crew, *, time_s: float) -> Traffic:
    """The traffic that the scenario's layout asks for, at its first moment; `time_s` is how long it must last."""
    if options.layout == "highway":
        return highway_traffic(options, drawn, crew, time_s=time_s)
    if options.layout == "intersection":
        return JunctionTraffic(options, drawn, crew)
    site = roundabout_site(drawn) if options.layout == "roundabout" else SITES[options.layout](drawn)
    return OpenTraffic(site, options, crew, time_s=time_s)
