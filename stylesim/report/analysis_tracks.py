"""Figures of KDSC in `stylesim analyze`: mean speeds of the clusters, and example tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from stylesim.evaluation.analysis.clusters import CLUSTERS
from stylesim.evaluation.analysis.examples import Example
from stylesim.evaluation.analysis.parts import SEVERAL, TRAIN, held_out_of
from stylesim.evaluation.analysis.tables import Frame, known, where
from stylesim.evaluation.intervals import MIN_DRIVERS
from stylesim.report.theme import drawing, style_colour

WIDTH = 8.6
MOST_COLUMNS = 3  # chosen: narrower panels have no room for their legends
SPEED_BINS = 24  # chosen: about 1 m/s wide in towns
COLOUR = {"aggressive": "#E69F00", "normal": "#0072B2"}  # orange and blue, as in the paper's figure


def speeds_figures(drivers: Frame, corpora: Sequence[str]) -> list[Figure]:
    """Densities of mean speed per cluster: training above, held out below, one column per corpus.

    A cluster of fewer than 30 drivers is not drawn, nor a corpus without any such cluster; MOST_COLUMNS to a figure.
    """
    named = known(drivers, "kdsc")
    sizes = named.group_by("corpus", "part", "kdsc").len()
    sizes = sizes.filter((sizes["len"] >= MIN_DRIVERS) & (sizes["part"] != SEVERAL))
    large = set(sizes["corpus"].to_list())
    shown = [c for c in corpora if c in large]
    return [_speeds(named, shown[i : i + MOST_COLUMNS]) for i in range(0, len(shown), MOST_COLUMNS)]


def _speeds(named: Frame, shown: Sequence[str]) -> Figure:
    with drawing():
        figure = Figure(figsize=(min(WIDTH, 2.9 * max(2, len(shown))), 4.2), layout="constrained")
        grid = figure.subplots(2, len(shown), squeeze=False, sharex="col")
        for column, corpus in enumerate(shown):
            own = where(named, corpus=corpus)
            others = held_out_of(set(own["part"].to_list()))
            held = "test" if "test" in others else (others[0] if others else "held out")
            edges = np.linspace(0, float(np.ceil(own["mean_speed"].max() or 1.0)), SPEED_BINS + 1)  # type: ignore[arg-type]
            for axes, part in zip(grid[:, column], (TRAIN, held), strict=True):
                for cluster in CLUSTERS:
                    value = where(own, part=part, kdsc=cluster)["mean_speed"].to_numpy()
                    label = f"{cluster}, n = {len(value)}"
                    if len(value) < MIN_DRIVERS:
                        axes.plot([], [], color=COLOUR[cluster], label=f"{label}: too few")
                        continue
                    axes.hist(value, bins=edges, density=True, color=COLOUR[cluster], alpha=0.4, label=label)
                    axes.axvline(float(np.median(value)), color=COLOUR[cluster], lw=1.4)
                axes.set_title(f"{corpus}, {part}", fontsize=8.5)
                axes.set_yticks([])
                axes.set_xlim(0, edges[-1])
                axes.margins(y=0.35)  # room for the legend above the bars
                axes.legend(fontsize=7, loc="upper right")
            grid[1, column].set_xlabel("mean speed (m/s)")
    return figure


def examples_figure(examples: Sequence[Example]) -> Figure | None:
    """Each example's track as dots 0.1 s apart coloured by time, with its speed beside it; None without one."""
    if not examples:
        return None
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.9 * len(examples)), layout="constrained")
        grid = figure.subplots(len(examples), 2, squeeze=False, width_ratios=(1.5, 1))
        for (left, right), one in zip(grid, examples, strict=True):
            for line in one.lanes_m:
                left.plot(*line.T, color="#C3CAD1", lw=0.8, zorder=1)
            dots = left.scatter(*one.position_m.T, c=one.time_s, cmap="viridis", s=9, zorder=3, linewidths=0)
            forward = np.array([np.cos(one.heading_rad), np.sin(one.heading_rad)])
            sideways = np.array([-forward[1], forward[0]])
            length, width = one.size_m
            corners = [one.position_m[0] + a * length / 2 * forward + b * width / 2 * sideways
                       for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]  # fmt: skip
            left.add_patch(Polygon(corners, fill=False, ec="#0044CC", lw=1.4, zorder=4))
            low, high = one.position_m.min(axis=0), one.position_m.max(axis=0)
            half = max(25.0, float((high - low).max()) / 2 + 6.0)
            middle = (low + high) / 2
            left.set_xlim(middle[0] - 1.5 * half, middle[0] + 1.5 * half)
            left.set_ylim(middle[1] - half, middle[1] + half)
            left.set_aspect("equal")
            left.grid(visible=False)
            left.set_title(f"{one.corpus}: KDSC {one.cluster}, TDBM {one.tdbm}", fontsize=8.5)
            left.set_xlabel("x (m)")
            left.set_ylabel("y (m)")
            figure.colorbar(dots, ax=left, label="time (s)", shrink=0.8)
            right.plot(one.time_s, one.speed_mps, color=style_colour(one.cluster), lw=1.6)
            right.set_ylim(0, max(5.0, 1.1 * float(one.speed_mps.max())))
            right.set_xlabel("time (s)")
            right.set_ylabel("speed (m/s)")
    return figure
