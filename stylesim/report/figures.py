"""Figures of errors and training: what a forecaster gets wrong, and how it learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from stylesim.evaluation.results import HEADINGS, Evaluation
from stylesim.evaluation.slices import Slice, value_order
from stylesim.evaluation.strata import title_of
from stylesim.report.theme import SERIES_COLOUR, SERIES_MARKER, drawing, new_figure, plural

Curve = Sequence[
    Mapping[str, int | float | None]
]  # records with epoch, train_loss, val_loss, val_min_fde_m (or min_fde_m)
WIDTH = 8.6  # inches; the page's column
MOST_UPRIGHT = 8  # chosen: more names do not fit beside one another
MOST_CELLS = 40  # chosen: above it a figure of cells cannot be read and the table has to do


def cell_values(evaluations: Sequence[Evaluation], by: str) -> list[str]:
    """The values of a stratum over all evaluations, in the order of a table."""
    return sorted({item.value for one in evaluations if by in one.by for item in one.slices_by(by)}, key=value_order)


def _tick(cells: Sequence[Slice], value: str, *, upright: bool) -> str:
    """The value with the n of its largest cell; forecasters on one corpus share it."""
    size = max((c.size for c in cells if c.value == value), key=lambda s: s.n_drivers)
    between = "\n" if upright else ", "
    return between.join([f"{value}\nn = {size.n_drivers}", plural(size.n_units, "unit")])


def _series(
    axes: Axes, cells: Sequence[Slice], values: Sequence[str], metric: str, place: float, number: int, upright: bool
) -> None:
    colour, marker = SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]
    for item in cells:
        estimate, at = item.metrics[metric], values.index(item.value) + place
        if estimate.refused:
            continue
        within = estimate.status == "within site"
        bar, point = ([at, at], [estimate.low, estimate.high]), ([at], [estimate.value])
        axes.plot(*(bar if upright else bar[::-1]), color=colour, lw=1.6, ls=":" if within else "-")
        axes.plot(*(point if upright else point[::-1]), marker, color=colour, mfc="white" if within else colour, ms=6)


def _category_axis(axes: Axes, cells: Sequence[Slice], values: Sequence[str], metric: str, *, upright: bool) -> None:
    """Names and n of the cells on their axis, "too few" where none is shown, the metric on the other."""
    ticks = [_tick(cells, value, upright=upright) for value in values]
    for at, value in enumerate(values):
        if all(item.metrics[metric].refused for item in cells if item.value == value):
            axes.annotate(
                "too few",
                (at, 0.02) if upright else (0.01, at),
                xycoords=("data", "axes fraction") if upright else ("axes fraction", "data"),
                ha="center" if upright else "left",
                va="bottom" if upright else "center",
                color="#6B7680",
            )
    if upright:
        axes.set_xticks(range(len(values)), ticks, fontsize=8)
        axes.set_xlim(-0.6, len(values) - 0.4)
        axes.set_ylim(bottom=0)
        axes.set_ylabel(HEADINGS[metric])
    else:
        axes.set_yticks(range(len(values)), ticks, fontsize=8)
        axes.set_ylim(len(values) - 0.4, -0.6)
        axes.set_xlim(left=0)
        axes.set_xlabel(HEADINGS[metric])
    axes.grid(visible=False, axis="x" if upright else "y")


def error_figure(evaluations: Sequence[Evaluation], by: str, *, metric: str = "min_fde_m") -> Figure | None:
    """One metric per value of `by` with its interval, forecasters side by side; None where nothing can be drawn.

    Refused cells say "too few" in place of a point. Hollow points with dotted bars are within-site intervals.
    """
    shown = [one for one in evaluations if by in one.by]
    values = cell_values(shown, by)
    every = [item for one in shown for item in one.slices_by(by)]
    if not values or len(values) > MOST_CELLS or all(item.metrics[metric].refused for item in every):
        return None
    with drawing():
        upright = len(values) <= MOST_UPRIGHT
        figure, (axes,) = new_figure(WIDTH, 3.9 if upright else 1.2 + 0.42 * len(values))
        places = (np.arange(len(shown)) - (len(shown) - 1) / 2) * min(0.16, 0.7 / len(shown))
        for number, one in enumerate(shown):
            _series(axes, one.slices_by(by), values, metric, float(places[number]), number, upright)
            colour, marker = SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]
            axes.plot([], [], marker, color=colour, label=one.forecaster)
        _category_axis(axes, every, values, metric, upright=upright)
        axes.set_title(f"{HEADINGS[metric].split(' (')[0]} by {title_of(by)}: mean over drivers, 95 % intervals")
        figure.legend(loc="outside lower center", ncols=min(4, len(shown)))
    return figure


LEGEND_ROOM = 0.45  # of the height, above the curves; chosen: two models' legend fits


def finite_pairs(curve: Curve, name: str) -> tuple[list[float], list[float]]:
    """(epochs, values) of one quantity of a training record, where it was measured."""
    found = [(point.get("epoch"), point.get(name, point.get(name.removeprefix("val_")))) for point in curve]
    pairs = [(float(e), float(v)) for e, v in found if e is not None and v is not None and np.isfinite(v)]
    return [epoch for epoch, _ in pairs], [value for _, value in pairs]


def _best(curve: Curve) -> str:
    epochs, values = finite_pairs(curve, "val_min_fde_m")
    return f", least {min(values):.2f} m in epoch {epochs[int(np.argmin(values))]:g}" if values else ""


def loss_figure(curves: Mapping[str, Curve]) -> Figure | None:
    """Training and validation loss, and validation minFDE, over epochs, one colour per model; None without a curve."""
    drawn = {name: curve for name, curve in curves.items() if len(curve)}
    if not drawn:
        return None
    with drawing():
        figure, (left, right) = new_figure(WIDTH, 3.2, columns=2)
        for number, (name, curve) in enumerate(drawn.items()):
            colour, marker = SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]
            left.plot(*finite_pairs(curve, "train_loss"), color=colour, ls="--", lw=1.2, label=f"{name}, training")
            left.plot(*finite_pairs(curve, "val_loss"), color=colour, lw=1.6, label=f"{name}, validation")
            label = f"{name}{_best(curve)}"
            right.plot(*finite_pairs(curve, "val_min_fde_m"), color=colour, marker=marker, ms=3.5, lw=1.4, label=label)
        for axes, title, unit in (
            (left, "Loss over epochs", "loss (as trained)"),
            (right, "Validation minFDE over epochs", "minFDE (m)"),
        ):
            axes.set_title(title)
            axes.set_xlabel("epoch")
            axes.set_ylabel(unit)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            low, high = axes.get_ylim()
            axes.set_ylim(low, high + LEGEND_ROOM * (high - low))
            axes.legend(loc="upper right")
    return figure
