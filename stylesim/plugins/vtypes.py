"""A population as a file of vehicle types for the plain `sumo` program."""

from __future__ import annotations

import re
from pathlib import Path
from xml.sax.saxutils import quoteattr

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.plugins.base_types import base_types_xml
from stylesim.population import Population
from stylesim.randomness import stream
from stylesim.simulation.sumo.demand import ROUTES_HEAD, type_xml
from stylesim.simulation.sumo.vehicles import Driver, draw_body
from stylesim.style import STYLE_CLASSES

NOTE = """<!--
  Vehicle types of drivers of the population {name} (seed {seed}), made by `stylesim export sumo-vtypes`.
  Use: sumo … -a THIS_FILE, and type="{id}" on your vehicles, trips or flows. The options step-length 0.1 and
  lanechange.duration 4.5 let the styles show (a comment cannot hold their two dashes).

  What a file alone cannot carry, and `stylesim.populate` or `stylesim generate` do:
  * the decision at a yellow light (SUMO stops whoever can; a human's P(stop) is a curve over the time to the line),
    and who runs a red light;
  * the wander in the lane, which is added to the logged tracks;
  * a driver per vehicle: here {count} drivers are shared by all vehicles of the distribution;
  * the log with each driver's style, as a corpus.
  The types stylesim/pedal/… are for `stylesim.populate`, which copies them; no vehicle has them by itself.
-->"""


def distribution_id(population: Population) -> str:
    """The id of a population's vTypeDistribution: what SUMO does not take in an id, and a double dash, becomes `_`."""
    return "stylesim." + re.sub(r"[^A-Za-z0-9_.+=-]|--", "_", population.name)


def export_vtypes(
    population: Population | str, out: str | Path, *, types: int = 120, truck_share: float = 0.0, seed: int = 0
) -> Path:
    """Write a vTypeDistribution of drivers of the population; returns the file's path.

    `types` drivers are drawn, each class its share of them (at least one where the share is not 0), and the
    probabilities of a class's drivers sum to its share. The distribution's id is `distribution_id`.
    Raises InputError for what does not fit, and if `out` exists.
    """
    crowd = Population.load(population) if isinstance(population, str) else population
    out = Path(out)
    if types < len(STYLE_CLASSES):
        raise InputError(f"types must be at least {len(STYLE_CLASSES)}, one for each class, not {types}")
    if not 0.0 <= truck_share <= 1.0:
        raise InputError(f"truck_share must lie in [0, 1], not {truck_share}")
    if out.exists():
        raise InputError(f"{out} is there already; choose another --out, or remove it first")
    if not out.absolute().parent.is_dir():
        raise InputError(f"{out.absolute().parent}: no such folder")
    rows = [
        row
        for name, share in crowd.by_class.items()
        if share > 0
        for row in _rows(crowd, name, share, count=max(1, round(types * share)), truck_share=truck_share, seed=seed)
    ]
    identity = distribution_id(crowd)
    note = NOTE.format(name=identity.removeprefix("stylesim."), seed=seed, id=identity, count=len(rows))
    lines = [ROUTES_HEAD, note, *base_types_xml(), f"<vTypeDistribution id={quoteattr(identity)}>", *rows]
    write_whole(out, "\n".join([*lines, "</vTypeDistribution>", "</routes>", ""]).encode())
    return out


def _rows(crowd: Population, name: str, share: float, *, count: int, truck_share: float, seed: int) -> list[str]:
    """The vTypes of one class, with equal probabilities that sum to its share."""
    only = crowd if crowd.within_class == "neutral" else crowd.reweighted(**{name: 1.0})
    rows = []
    for number in range(count):
        driver_id = f"stylesim.{name}.{number:03d}"
        body = stream(seed, 0, driver_id, "body")
        kind, length, width = draw_body(truck=bool(body.random() < truck_share), rng=body)
        style = only.draw(stream(seed, 0, driver_id, "style"), backend="sumo")
        driver = Driver(driver_id, style, kind, length, width, 0.0, "")
        rows.append(type_xml(driver).replace("/>", f' probability="{share / count:.8f}"/>'))
    return rows
