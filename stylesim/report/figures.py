"""Figures of errors and training: what a forecaster gets wrong, and how it learned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from stylesim.evaluation.results import HEADINGS, Evaluation
from stylesim.evaluation.slices import Slice, value_order
from stylesim.report.theme import SERIES_COLOUR, SERIES_MARKER, drawing, new_figure

Curve = Sequence[Mapping[str, float]]  # records with epoch, train_loss, val_loss, val_min_fde_m
WIDTH = 8.6  # inches; the page's column
MOST_CELLS = 40  # chosen: above it a figure of cells cannot be read and the table has to do


def cell_values(evaluations: Sequence[Evaluation], by: str) -> list[str]:
    """The values of a stratum over all evaluations, in the order of a table."""
    return sorted({item.value for one in evaluations if by in one.by for item in one.slices_by(by)}, key=value_order)


def _tick(cells: Sequence[Slice], value: str) -> str:
    """The value with the n of its largest cell; forecasters on one corpus share it."""
    size = max((c.size for c in cells if c.value == value), key=lambda s: s.n_drivers)
    return f"{value.replace(' × ', chr(10))}\nn = {size.n_drivers}\n{size.n_units} units"


def _series(axes: Axes, cells: Sequence[Slice], values: Sequence[str], metric: str, place: float, number: int) -> None:
    colour, marker = SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]
    for item in cells:
        estimate, x = item.metrics[metric], values.index(item.value) + place
        if estimate.refused:
            continue
        within = estimate.status == "within site"
        axes.plot([x, x], [estimate.low, estimate.high], color=colour, lw=1.6, ls=":" if within else "-")
        axes.plot([x], [estimate.value], marker, color=colour, mfc="white" if within else colour, ms=6)


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
        figure, (axes,) = new_figure(WIDTH, 3.9)
        places = (np.arange(len(shown)) - (len(shown) - 1) / 2) * min(0.16, 0.7 / len(shown))
        for number, one in enumerate(shown):
            _series(axes, one.slices_by(by), values, metric, float(places[number]), number)
            colour, marker = SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]
            axes.plot([], [], marker, color=colour, label=one.forecaster)
        for x, value in enumerate(values):
            if all(item.metrics[metric].refused for item in every if item.value == value):
                axes.annotate("too few", (x, 0.02), xycoords=("data", "axes fraction"), ha="center", color="#6B7680")
        axes.set_xticks(range(len(values)), [_tick(every, value) for value in values], fontsize=8)
        axes.set_xlim(-0.6, len(values) - 0.4)
        axes.set_ylim(bottom=0)
        axes.grid(visible=False, axis="x")
        axes.set_ylabel(HEADINGS[metric])
        axes.set_title(f"{HEADINGS[metric].split(' (')[0]} by {by}, mean over drivers with 95 % intervals")
        figure.legend(loc="outside lower center", ncols=min(4, len(shown)))
    return figure


def finite_pairs(curve: Curve, name: str) -> tuple[list[float], list[float]]:
    """(epochs, values) of one quantity of a training record, where it was measured."""
    pairs = [
        (float(point["epoch"]), float(point[name]))
        for point in curve
        if point.get(name) is not None and np.isfinite(point[name])
    ]
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
            axes.legend(loc="upper right")
        right.set_ylim(bottom=0)
    return figure
