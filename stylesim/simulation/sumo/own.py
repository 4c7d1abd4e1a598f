"""`own_network`: a scenario made of a user's own network, with generated demand or the demand of a route file."""

from __future__ import annotations

import re
import shutil
import tempfile
from pathlib import Path

import yaml

from stylesim.corpus.files import sha256_of
from stylesim.errors import InputError
from stylesim.resources import cache_dir
from stylesim.simulation.sumo.demanded import read_route_file
from stylesim.simulation.sumo.importing import import_network
from stylesim.simulation.sumo.network import sumo_version
from stylesim.simulation.sumo.options import OwnNetwork
from stylesim.simulation.sumo.ways import generated_demand

VPH_PER_LANE = 300.0  # chosen, because a lane that enters a town carries 100 to 600 vehicles/h outside the rush hour
AROUND = 0.3  # chosen: episodes vary by so much around the demand
NET, DEMAND = "own.net.xml", "own.rou.xml"


def own_network(
    net: str | Path,
    *,
    demand: str | Path | None = None,
    vph: float | None = None,
    duration_s: float = 300.0,
    warm_up_s: float = 120.0,
) -> Path:
    """The folder of a scenario in that network, for `generate` and everything else that takes a scenario.

    `net` is a SUMO network, an OpenStreetMap extract or an OpenDRIVE map. Traffic comes in at the fringe, `vph`
    vehicles/h in all (drawn within 30 % per episode; by default 300 for each lane that enters), or as the route file
    `demand` says. The folder lies in the cache; what was given is known by its sha256.
    Raises InputError, naming the file, for what cannot be read or simulated.
    """
    source, routes = Path(net), None if demand is None else Path(demand)
    if vph is not None and routes is not None:
        raise InputError("give either a demand file or vehicles per hour, not both")
    if vph is not None and not 0.0 < vph <= 100_000.0:
        raise InputError(f"vph: a number of vehicles/h above 0, not {vph:g}")
    if not (duration_s > 0.0 and warm_up_s >= 0.0):
        raise InputError(f"duration and warm-up must be positive, not {duration_s:g} s and {warm_up_s:g} s")
    base = cache_dir() / "own"
    base.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=base, prefix="importing-") as work:
        made = Path(work) / "scenario"
        made.mkdir()
        kind = import_network(source, made / NET)
        own = OwnNetwork(net=NET, kind=kind, sha256=sha256_of(source))
        if routes is not None:
            read_route_file(routes)
            shutil.copyfile(routes, made / DEMAND)
            own = own.model_copy(update={"demand": DEMAND, "demand_sha256": sha256_of(routes)})
        spec = _specification(source, made / NET, own, vph=vph, duration_s=duration_s, warm_up_s=warm_up_s)
        (made / "scenario.yaml").write_text(yaml.safe_dump(spec, sort_keys=False), encoding="utf-8")
        key = sha256_of(made / "scenario.yaml")[:24]
        target = base / f"{key}-{sumo_version()}"
        if not target.is_dir():
            made.rename(target)
    return target


def _specification(
    source: Path, made: Path, own: OwnNetwork, *, vph: float | None, duration_s: float, warm_up_s: float
) -> dict[str, object]:
    """scenario.yaml."""
    parameters: dict[str, object] = {
        "truck_share": {
            "unit": "1",
            "source": "urban roads carry about 2 to 10 % heavy vehicles; chosen within that",
            "low": 0.02,
            "high": 0.08,
        }
    }
    about = f"{source.name}, sha256 {own.sha256}."
    if own.demand:
        about += " Traffic as the route file says."
    else:
        found = generated_demand(made)
        middle = vph if vph is not None else VPH_PER_LANE * found.entry_lanes
        said = "given by the user" if vph is not None else f"chosen, {VPH_PER_LANE:g} for each lane that enters"
        about += f" Traffic between {len(found.flows)} entries and the exits that they lead to."
        about += f" Left out: {found.left_out}." if found.left_out else ""
        parameters["demand_vph"] = {
            "unit": "vehicles/h (all entries)",
            "source": f"{said}; episodes vary by 30 %",
            "low": round(middle * (1.0 - AROUND), 3),
            "high": round(middle * (1.0 + AROUND), 3),
        }
    return {
        "name": "net_" + (re.sub(r"[^a-z0-9]+", "_", source.name.split(".")[0].lower()).strip("_")[:40] or "own"),
        "backend": "sumo",
        "title": f"The user's network {source.name}",
        "about": about,
        "duration_s": duration_s,
        "warm_up_s": warm_up_s,
        "parameters": parameters,
        "options": {"own": own.model_dump(), "last_entry_share": 0.94},
    }
