"""Figures of fidelity: confusion matrices, knob against measured aggressiveness, what features left a class."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stylesim.evaluation.fidelity_agreement import Agreement
from stylesim.evaluation.fidelity_ranges import FeatureRanges, needed_ranges
from stylesim.evaluation.fidelity_results import Fidelity
from stylesim.report.figures import WIDTH
from stylesim.report.theme import FAINT, INK, drawing, new_figure, style_colour, style_marker
from stylesim.style import CLASS_INTERVAL, STYLE_CLASSES

MOST_DOTS = 4000  # chosen: more dots hide each other
DARK = 0.55  # share from which white text reads better


def matrix_figure(found: Sequence[Agreement], titles: Sequence[str]) -> Figure:
    """Confusion matrices side by side, in % of each commanded class."""
    with drawing():
        figure, panels = new_figure(WIDTH if len(found) > 1 else WIDTH * 0.72, 3.7, columns=len(found))
        for place, (axes, one, title) in enumerate(zip(panels, found, titles, strict=True)):
            _matrix(axes, one, title, names=place == 0)
    return figure


def _matrix(axes: Axes, one: Agreement, title: str, *, names: bool) -> None:
    total = one.count.sum(axis=1, keepdims=True)
    share = np.where(total > 0, one.count / np.maximum(total, 1), np.nan)
    axes.imshow(np.nan_to_num(share), cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for row, column in np.ndindex(share.shape):
        if np.isfinite(share[row, column]):
            colour = "white" if share[row, column] > DARK else INK
            axes.text(column, row, f"{100 * share[row, column]:.0f}", ha="center", va="center", color=colour, size=9)
    rows = [f"{name} (n = {n})" for name, n in zip(STYLE_CLASSES, one.per_class, strict=True)]
    axes.set_yticks(range(len(rows)), rows if names else [""] * len(rows))
    axes.set_xticks(range(len(one.measured)), one.measured, rotation=30, ha="right")
    axes.grid(visible=False)
    axes.set_xlabel("measured class")
    if names:
        axes.set_ylabel("commanded class")
    axes.set_title(title)


def knob_figure(found: Fidelity) -> Figure | None:
    """Measured aggressiveness of every driver over the commanded knob; None where nobody was measured."""
    commanded = np.array(found.commanded, dtype=object)
    known = np.isfinite(found.measured_a)
    if not known.any():
        return None
    with drawing():
        figure, (axes,) = new_figure(WIDTH * 0.8, 3.8)
        step = max(1, int(known.sum()) // MOST_DOTS + 1)
        for name in STYLE_CLASSES:
            own = np.flatnonzero(known & (commanded == name))
            low, high = CLASS_INTERVAL[name]
            axes.axvspan(low, high, color=style_colour(name), alpha=0.06, lw=0)
            shown = own[::step]
            axes.scatter(
                found.knob[shown], found.measured_a[shown], s=9, marker=style_marker(name), color=style_colour(name),
                alpha=0.5, lw=0, label=f"{name}, n = {len(own)}",
            )  # fmt: skip
            if len(own):
                middle = float(np.median(found.measured_a[own]))
                axes.plot([low, high], [middle, middle], color=style_colour(name), lw=2.2)
        axes.set_xlabel("commanded knob (aggressiveness)")
        axes.set_ylabel("measured a (TDBM, sim-reference)")
        axes.set_title("Commanded knob and measured aggressiveness; bars: median of the class")
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def ranges_figure(one: FeatureRanges) -> Figure:
    """Per scaled feature and class: the range that the class needs (grey) and the one that its drivers had."""
    needs = needed_ranges()
    with drawing():
        figure, panels = new_figure(WIDTH, 2.9, columns=len(one.names))
        for k, (axes, name) in enumerate(zip(panels, one.names, strict=True)):
            for row, style in enumerate(STYLE_CLASSES):
                axes.barh(row, needs[row, k, 1] - needs[row, k, 0], left=needs[row, k, 0], height=0.72, color=FAINT)
                low, high = one.left[row, k]
                if np.isfinite(low):
                    axes.plot([low, high], [row, row], color=style_colour(style), lw=4, solid_capstyle="butt")
                    axes.plot([low, high], [row, row], "|", color=style_colour(style), ms=9)
            axes.set_xlim(-0.04, 1.04)
            axes.set_xticks([0, 0.5, 1], ["0", "½", "1"])
            axes.set_yticks(range(len(STYLE_CLASSES)), STYLE_CLASSES if k == 0 else [""] * len(STYLE_CLASSES))
            axes.invert_yaxis()
            axes.grid(visible=False, axis="y")
            axes.set_title(name)
        figure.supxlabel("scaled feature, 5 to 95 %; grey: where the class has the highest score", size=9)
    return figure
