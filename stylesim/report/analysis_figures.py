"""Figures of `stylesim analyze`: class shares, kinematics by class, stability, shift."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stylesim.evaluation.analysis.kinematics import QUANTITIES
from stylesim.evaluation.analysis.shares import NAMES, ORIENTATIONS
from stylesim.evaluation.analysis.tables import Frame, known, where
from stylesim.report.theme import SERIES_COLOUR, SERIES_MARKER, drawing, new_figure, style_colour
from stylesim.style import STYLE_CLASSES

WIDTH = 8.6
SOFT = "#6B7680"
MOST_SIDE_BY_SIDE = 4  # chosen: corpora whose intervals can still be told apart in one figure
LABELLED_SHARE = 8.0  # %; chosen: a narrower piece has no room for its number
TITLES = {"printed": "printed orientation, s = B·x", "transposed": "transposed, s = Bᵀ·x"}


def look(number: int) -> tuple[str, str]:
    """Colour and marker of the corpus of that number."""
    return SERIES_COLOUR[number % len(SERIES_COLOUR)], SERIES_MARKER[number % len(SERIES_MARKER)]


def _corpora(table: Frame) -> list[str]:
    return list(dict.fromkeys(table["corpus"].to_list()))


def _whisker(axes: Axes, row: dict[str, Any], y: float, number: int, *, scale: float = 1.0, within: bool) -> None:
    colour, marker = look(number)
    if row["low"] is not None:
        axes.plot([scale * row["low"], scale * row["high"]], [y, y], color=colour, lw=1.5, ls=":" if within else "-")
    axes.plot(scale * row["value"], y, marker, color=colour, mfc="white" if within else colour, ms=5)


def shares_figure(table: Frame) -> Figure:
    """Share of each class per corpus, both orientations side by side.

    Up to MOST_SIDE_BY_SIDE corpora have a bar per class with its 95 % interval; more of them one stacked bar each.
    """
    corpora = _corpora(table)
    if len(corpora) > MOST_SIDE_BY_SIDE:
        return _stacked(table)
    with drawing():
        figure, panels = new_figure(WIDTH, 1.5 + 0.17 * len(NAMES) * max(2, len(corpora)), columns=2)
        step = 0.8 / len(corpora)
        for axes, orientation in zip(panels, ORIENTATIONS, strict=True):
            for number, corpus in enumerate(corpora):
                own = where(table, corpus=corpus, orientation=orientation)
                n = own["n_drivers"][0]
                axes.plot([], [], look(number)[1], color=look(number)[0], label=f"{corpus}, n = {n}")
                for row in own.iter_rows(named=True):
                    y = NAMES.index(row["class"]) - 0.4 + step * (number + 0.5)
                    if row["value"] is None:
                        axes.annotate("too few", (1, y), va="center", size=7, color=SOFT)
                        continue
                    axes.barh(y, 100 * row["value"], height=0.8 * step, color=look(number)[0], alpha=0.3)
                    _whisker(axes, row, y, number, scale=100, within=row["status"] == "within site")
            axes.set_yticks(range(len(NAMES)), NAMES)
            axes.set_ylim(len(NAMES) - 0.5, -0.5)
            axes.set_xlim(left=0)
            axes.grid(visible=False, axis="y")
            axes.set_xlabel("share of drivers (%)")
            axes.set_title(TITLES[orientation])
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=min(4, len(corpora)))
    return figure


def _stacked(table: Frame) -> Figure:
    """One bar per corpus, cut into its classes; corpora that are too small say so."""
    corpora = _corpora(table)
    with drawing():
        figure, panels = new_figure(WIDTH, 1.3 + 0.32 * len(corpora), columns=2)
        for axes, orientation in zip(panels, ORIENTATIONS, strict=True):
            for y, corpus in enumerate(corpora):
                left = 0.0
                for row in where(table, corpus=corpus, orientation=orientation).iter_rows(named=True):
                    if row["value"] is None:
                        axes.annotate("too few", (1, y), va="center", size=7.5, color=SOFT)
                        break
                    share = 100 * row["value"]
                    axes.barh(y, share, left=left, height=0.72, color=style_colour(row["class"]), ec="white", lw=0.6)
                    if share >= LABELLED_SHARE:
                        axes.text(
                            left + share / 2, y, f"{share:.0f}", ha="center", va="center", size=7.5, color="white"
                        )
                    left += share
            names = [f"{c}, n = {where(table, corpus=c)['n_drivers'][0]}" for c in corpora]
            axes.set_yticks(range(len(corpora)), names if axes is panels[0] else [""] * len(corpora))
            axes.set_ylim(len(corpora) - 0.5, -0.5)
            axes.set_xlim(0, 100)
            axes.grid(visible=False)
            axes.set_xlabel("share of drivers (%)")
            axes.set_title(TITLES[orientation])
        for name in NAMES:
            panels[0].barh(0, 0, color=style_colour(name), label=name)
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(NAMES))
    return figure


def boxes_figure(table: Frame, corpus: str) -> Figure | None:
    """Box plots of the kinematics per class: median, quartiles, whiskers at 5 and 95 %; None where all are refused."""
    own = where(table, corpus=corpus)
    if (own["status"] == "too few").all():
        return None
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.9), layout="constrained")
        panels = figure.subplots(2, 4).ravel()
        for axes, (name, (title, unit, circular)) in zip(panels, QUANTITIES.items(), strict=True):
            for row in where(own, quantity=name).iter_rows(named=True):
                x = STYLE_CLASSES.index(row["class"])
                if row["status"] == "too few":
                    axes.annotate("too few", (x, 0.03), xycoords=("data", "axes fraction"), rotation=90, ha="center",
                                  va="bottom", size=7, color=SOFT)  # fmt: skip
                    continue
                box = {"med": row["p50"], "q1": row["p25"], "q3": row["p75"], "whislo": row["p05"],
                       "whishi": row["p95"], "fliers": []}  # fmt: skip
                drawn = axes.bxp([box], positions=[x], widths=0.65, showfliers=False, patch_artist=True,
                                 manage_ticks=False, medianprops={"color": "#1F2933", "lw": 1.4})  # fmt: skip
                drawn["boxes"][0].set(facecolor=style_colour(row["class"]), edgecolor="#1F2933", alpha=0.8)
            axes.set_title(title + (" *" if circular else ""), fontsize=8.5)
            axes.set_ylabel(unit, fontsize=8)
            axes.set_xlim(-0.6, len(STYLE_CLASSES) - 0.4)
            axes.grid(visible=False, axis="x")
            bottom = axes in panels[4:]
            axes.set_xticks(range(len(STYLE_CLASSES)), STYLE_CLASSES if bottom else [""] * len(STYLE_CLASSES),
                            rotation=60, ha="right", rotation_mode="anchor", fontsize=7.5)  # fmt: skip
        sizes = where(own, quantity="mean_speed").select("class", "n_drivers").iter_rows()
        figure.suptitle(
            f"{corpus}: " + ", ".join(f"{style} {n}" for style, n in sizes), fontsize=8.5, x=0.01, ha="left"
        )
    return figure


def stability_figure(table: Frame) -> Figure | None:
    """ICC(1) of a and kappa of the class between windows of one driver, all contexts; None where all are refused."""
    shown = known(where(table, context="all"), "value")
    if not shown.height:
        return None
    figures = list(dict.fromkeys(shown["figure"].to_list()))
    lengths = sorted(set(shown["window_s"].to_list()))
    corpora = _corpora(shown)
    with drawing():
        figure, panels = new_figure(WIDTH, 1.5 + 0.16 * len(figures) * len(corpora), columns=len(lengths))
        for axes, length in zip(panels, lengths, strict=True):
            step = 0.8 / len(corpora)
            for row in where(shown, window_s=length).iter_rows(named=True):
                number = corpora.index(row["corpus"])
                y = figures.index(row["figure"]) - 0.4 + step * (number + 0.5)
                _whisker(axes, row, y, number, within=row["status"] == "within site")
            axes.set_yticks(range(len(figures)), figures)
            axes.set_ylim(len(figures) - 0.5, -0.5)
            axes.axvline(0, color=SOFT, lw=0.8)
            axes.set_xlim(-0.3, 1.0)
            axes.grid(visible=False, axis="y")
            axes.set_title(f"windows of {length:g} s")
        _legend(figure, panels[0], corpora)
    return figure


def shift_figure(table: Frame) -> Figure | None:
    """Held-out minus training share of each class, both orientations; None where all are refused."""
    shown = known(table, "value") if table.height else table
    if not shown.height:
        return None
    pairs = list(dict.fromkeys(zip(shown["corpus"].to_list(), shown["part"].to_list(), strict=True)))
    with drawing():
        figure, panels = new_figure(WIDTH, 1.6 + 0.16 * len(NAMES) * max(2, len(pairs)), columns=2)
        step = 0.8 / len(pairs)
        for axes, orientation in zip(panels, ORIENTATIONS, strict=True):
            for row in where(shown, orientation=orientation).iter_rows(named=True):
                number = pairs.index((row["corpus"], row["part"]))
                y = NAMES.index(row["class"]) - 0.4 + step * (number + 0.5)
                _whisker(axes, row, y, number, scale=100, within=row["status"] == "within site")
            axes.set_yticks(range(len(NAMES)), NAMES)
            axes.set_ylim(len(NAMES) - 0.5, -0.5)
            axes.axvline(0, color=SOFT, lw=0.8)
            axes.grid(visible=False, axis="y")
            axes.set_xlabel("percentage points")
            axes.set_title(TITLES[orientation])
        _legend(figure, panels[0], [f"{corpus}: {part} − train" for corpus, part in pairs])
    return figure


def _legend(figure: Figure, axes: Axes, names: Sequence[str]) -> None:
    for number, name in enumerate(names):
        axes.plot([], [], look(number)[1], color=look(number)[0], label=name)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=min(4, len(names)))


def answers_figure(table: Frame, corpus: str) -> Figure:
    """MDSI style (columns) against TDBM class (rows), drivers in each cell (the paper's heat map)."""
    own = where(table, corpus=corpus)
    mdsi, tdbm = (list(dict.fromkeys(own[c].to_list())) for c in ("mdsi", "tdbm"))
    count = np.zeros((len(tdbm), len(mdsi)), np.int64)
    for row in own.iter_rows(named=True):
        count[tdbm.index(row["tdbm"]), mdsi.index(row["mdsi"])] = row["count"]
    with drawing():
        figure, (axes,) = new_figure(WIDTH * 0.75, 3.9)
        axes.imshow(count, cmap="Blues", vmin=0, aspect="auto")
        for row_at, column in np.ndindex(count.shape):
            dark = count[row_at, column] > 0.55 * max(1, count.max())
            axes.text(column, row_at, str(count[row_at, column]), ha="center", va="center",
                      color="white" if dark else "#1F2933")  # fmt: skip
        axes.set_xticks(range(len(mdsi)), [name.replace("_", "-") for name in mdsi], rotation=20, ha="right")
        axes.set_yticks(range(len(tdbm)), tdbm)
        axes.set_xlabel("MDSI: what drivers say")
        axes.set_ylabel("TDBM: how they drove")
        axes.grid(visible=False)
        axes.set_title(f"{corpus}, {count.sum()} drivers with answers")
    return figure
