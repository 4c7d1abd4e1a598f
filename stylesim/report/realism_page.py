"""The page of `stylesim realism`: distributions beside each other, distances, targets."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stylesim.corpus.files import write_whole
from stylesim.errors import InputError
from stylesim.evaluation import distances
from stylesim.evaluation.exposure import Rate
from stylesim.evaluation.realism_profile import Profile
from stylesim.evaluation.realism_quantities import BINS, QUANTITIES
from stylesim.evaluation.realism_results import Comparison, QuantityDistance, Ratio, Realism, Spread
from stylesim.report.blocks import Block, Section, picture
from stylesim.report.figures import WIDTH
from stylesim.report.html import render
from stylesim.report.tables import EM, Cell, Table, facts_table, number, percent
from stylesim.report.theme import SERIES_COLOUR, drawing, plural

HOW = (
    "Frames of moving motor vehicles, each counted by its time. Matched: the simulation's frames are weighted so that "
    "its cells of speed and density (moving vehicles within 50 m) hold what the recording's hold; covered is the share "
    "of the recording in cells that both have. The distance is Wasserstein-1, in the quantity's unit. The floor is the "
    "matched distance between random halves of the recording itself: a simulation nearer than that cannot be told from "
    "it. The likelihood is of the recording under the matched simulation, in 20 bins, as in Waymo's Sim Agents; the "
    "best is what the recording's own distribution reaches. Intervals resample episodes and blocks of the recording; "
    "a resampled distance is rather too large than too small."
)


def save_realism(found: Realism, path: str | Path) -> Path:
    """Write the page (.html) whole or not at all, and return its path. InputError for another ending."""
    page = Path(path)
    if page.suffix != ".html":
        raise InputError(f"{page}: a report is an .html file")
    simulated, *recorded = found.profiles
    sections = [
        _section(one, simulated, profile, number=i)
        for i, (one, profile) in enumerate(zip(found.comparisons, recorded, strict=True))
    ]
    sections += [_between(found)] if found.between_recordings else []
    raw = json.dumps(dict(found.about), indent=1, sort_keys=True)
    facts = {"collisions per 1,000 km, simulation": _rate(found.collisions)}
    facts |= {f"collisions per 1,000 km, {one.real}": _rate(one.collisions) for one in found.comparisons}
    blocks = (
        Block(table=facts_table("Boxes that come to overlap, motor vehicles", facts)),
        Block(caption="About", raw=raw),
    )
    sections.append(Section("rest", "Collisions, and what was compared", (), blocks))
    lead = f"{found.sim} against {plural(len(found.about['real']), 'recording')}."
    write_whole(page, render("How real is the simulated traffic?", lead, sections, (), _findings(found)).encode())
    return page


def _rate(rate: Rate) -> str:
    return f"{rate.value:.3g} [{rate.low:.3g}, {rate.high:.3g}], {rate.events} in {1000 * rate.exposure:.0f} km"


def _findings(found: Realism) -> list[str]:
    listed = []
    for one in found.comparisons:
        known = [ratio for ratio in one.ratios if ratio.met is not None]
        missed = [ratio.name for ratio in known if not ratio.met]
        verdict = f"missed: {', '.join(missed)}" if missed else "all met"
        listed.append(f"{one.real}: {len(known)} of {len(one.ratios)} targets can be judged, {verdict}.")
    return listed


def _spread(value: Spread, digits: int = 2) -> Cell:
    if not math.isfinite(value.value):
        return Cell(EM, look="refused")
    ends = f"[{number(value.low, digits)}, {number(value.high, digits)}]" if math.isfinite(value.low) else ""
    return Cell(number(value.value, digits), ends, "number")


def _section(one: Comparison, sim: Profile, real: Profile, *, number: int) -> Section:
    what = "stretches of time within one or few units" if one.within_unit else "units"
    text = f"{plural(one.blocks, 'block')} of the recording ({what})."
    blocks = picture(
        densities_figure(sim, real),
        f"Matched to {one.real} by speed and density; filled: the recording; values beyond the axis are not drawn.",
    )
    blocks += [Block(table=_distances(one)), Block(table=_targets(one)), Block(table=_styles(one), fold=True)]
    return Section(f"real{number}", f"Against {one.real}", (text,) if number else (HOW, text), tuple(blocks))


def _distances(one: Comparison) -> Table:
    rows = tuple(
        (
            Cell(QUANTITIES[q.quantity].title, QUANTITIES[q.quantity].unit, "head"),
            _spread(q.distance), _spread(q.matched), percent(q.covered), _spread(q.floor),
            _likelihood(q),
            Cell(f"{q.sim_seconds / 60:.0f} / {q.real_seconds / 60:.1f}", look="number"),
        )
        for q in one.quantities
    )  # fmt: skip
    heads = ("quantity", "distance", "matched", "covered", "floor", "likelihood", "minutes, sim / real")
    return Table("Wasserstein-1 distances with 95 % intervals", heads, rows)


def _likelihood(one: QuantityDistance) -> Cell:
    known = math.isfinite(one.likelihood)
    return Cell(f"{one.likelihood:.3f}", f"best {one.best_likelihood:.3f}", "number") if known else Cell(EM)


def _targets(one: Comparison) -> Table:
    rows = tuple((Cell(r.name, look="head"), _side(r.sim), _side(r.real), _ratio(r)) for r in one.ratios)
    return Table("Held to a target, matched", ("figure", "simulation", "recording", "ratio"), rows)


def _side(value: float) -> Cell:
    return Cell(number(value, 2) if math.isfinite(value) else EM, look="number")


def _ratio(ratio: Ratio) -> Cell:
    cell = _spread(ratio.ratio)
    if ratio.met is None:
        return cell
    return Cell(cell.text, f"{cell.note}, within {100 * ratio.within:.0f} %", "better" if ratio.met else "worse")


def _styles(one: Comparison) -> Table:
    rows = []
    for style in one.styles:
        size = Cell(style.style, f"{style.sim_drivers} / {style.real_drivers} drivers", "head")
        values = [Cell("too few", look="refused")] * len(QUANTITIES)
        if style.matched is not None:
            values = [_spread(style.matched[name]) for name in QUANTITIES]
        rows.append((size, *values))
    heads = ("measured style", *(f"{q.title} ({q.unit})" for q in QUANTITIES.values()))
    return Table("Matched distance per measured style (simulation / recording)", heads, tuple(rows))


def _between(found: Realism) -> Section:
    rows = tuple(
        (Cell(" – ".join(pair), look="head"), *(_side(values[name]) for name in QUANTITIES))
        for pair, values in found.between_recordings.items()
    )
    heads = ("recordings", *(f"{q.title} ({q.unit})" for q in QUANTITIES.values()))
    table = Table("Matched distance between recordings", heads, rows)
    return Section("sites", "From site to site", (), (Block(table=table),))


def densities_figure(sim: Profile, real: Profile) -> Figure:
    """The matched distributions of every quantity: the recording filled, the simulation as a line."""
    ours, theirs = sim.pooled().sum(axis=0), real.pooled().sum(axis=0)
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
        panels = figure.subplots(2, 4).ravel()
        for k, (axes, one) in enumerate(zip(panels, QUANTITIES.values(), strict=False)):
            middle = one.low + one.width * (np.arange(BINS) + 0.5)
            a, b, _ = distances.matched(ours[:, k], theirs[:, k])
            if a.sum() > 0 and b.sum() > 0:
                p, q = a[:-1] / a.sum() / one.width, b[:-1] / b.sum() / one.width  # the last bin holds all beyond
                axes.fill_between(middle[:-1], q, step="mid", color=SERIES_COLOUR[0], alpha=0.25, lw=0)
                axes.step(middle[:-1], p, where="mid", color=SERIES_COLOUR[1], lw=1.3)
            axes.set_title(one.title, fontsize=8.5)
            axes.set_xlabel(one.unit)
            axes.set_yticks([])
            axes.set_ylim(bottom=0)
        panels[-1].axis("off")
        panels[-1].fill_between([], [], color=SERIES_COLOUR[0], alpha=0.25, label=real.name)
        panels[-1].plot([], [], color=SERIES_COLOUR[1], label=f"{sim.name}, matched")
        panels[-1].legend(loc="center")
    return figure
