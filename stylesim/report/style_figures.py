"""Figures of styles: class shares, commanded against measured, and the decision at the yellow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import expit
from scipy.stats import binomtest

from stylesim.evaluation.approaches import MAX_TTS_S, Approaches
from stylesim.evaluation.label_summary import RANK_CEILING, LabelSummary, SourceSummary
from stylesim.report.theme import SERIES_COLOUR, UNJUDGED_COLOUR, drawing, new_figure, style_colour
from stylesim.style import STYLE_CLASSES

WIDTH = 8.6
NEUTRAL_YELLOW = (2.14, 2.88)  # (k 1/s, m s), REFERENCE section 5: Rakha et al. 2007, drivers under 40
PER_POINT = 8  # chosen: decisions behind one point at least; a share of fewer says nothing
ROW = 0.045  # of the axis, between the rows of ticks
TTS_BIN_S = 1.0  # chosen: the curve rises over about 2 s; a point must not mix drivers who go with drivers who stop


def _share_panel(axes: Axes, sources: Sequence[tuple[str, SourceSummary]], title: str, *, transposed: bool) -> None:
    shown = [(name, one.classes_transposed if transposed else one.classes) for name, one in sources]
    classes = list(shown[0][1])
    height = 0.8 / len(shown)
    for number, (name, counts) in enumerate(shown):
        n = sum(counts.values())
        share = [100 * counts[c] / n if n else 0.0 for c in classes]
        y = np.arange(len(classes)) - 0.4 + height * (number + 0.5)
        label = f"{name}, n = {n}"
        axes.barh(y, share, height=height * 0.9, color=SERIES_COLOUR[number % len(SERIES_COLOUR)], label=label)
        for place, value in zip(y, share, strict=True):
            axes.annotate(
                f"{value:.0f}", (value, place), xytext=(3, 0), textcoords="offset points", va="center", size=7
            )
    axes.set_yticks(range(len(classes)), classes)
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("share of tracks (%)")
    axes.margins(x=0.12)
    axes.set_title(title)


def class_distribution_figure(summaries: Sequence[LabelSummary]) -> Figure | None:
    """Class shares of one method per source; for TDBM in both orientations side by side. None without a track."""
    several = len({s.corpus for s in summaries}) > 1
    sources = [(f"{one.source} ({s.corpus})" if several else one.source, one) for s in summaries for one in s.sources]
    sources = [(name, one) for name, one in sources if one.n]
    if not sources:
        return None
    both = all(one.classes_transposed for _, one in sources)
    method = summaries[0].method.upper()
    with drawing():
        rows = len(sources[0][1].classes) * max(len(sources), 2) * 0.16
        figure, panels = new_figure(WIDTH, 1.6 + rows, columns=2 if both else 1)
        if both:
            _share_panel(panels[0], sources, f"{method}, printed orientation (s = B·x)", transposed=False)
            _share_panel(panels[1], sources, f"{method}, transposed (s = Bᵀ·x)", transposed=True)
        else:
            _share_panel(panels[0], sources, f"{method} classes by source", transposed=False)
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(3, len(names)))
    return figure


def confusion_figure(summary: LabelSummary) -> Figure | None:
    """Commanded class against measured class, in % of each commanded row; None where nobody was commanded."""
    confusion = summary.confusion
    if confusion is None:
        return None
    share = confusion.share
    with drawing():
        figure, (axes,) = new_figure(WIDTH * 0.78, 3.9)
        axes.imshow(np.nan_to_num(100 * share), cmap="Blues", vmin=0, vmax=100, aspect="auto")
        for row, column in np.ndindex(confusion.count.shape):
            if np.isfinite(share[row, column]):
                text, dark = f"{100 * share[row, column]:.0f}", share[row, column] > 0.55
                axes.text(column, row, text, ha="center", va="center", color="white" if dark else "#1F2933", size=9)
        totals = confusion.count.sum(axis=1)
        axes.set_yticks(
            range(len(totals)), [f"{c} (n = {n})" for c, n in zip(confusion.commanded, totals, strict=True)]
        )
        axes.set_xticks(range(len(confusion.measured)), confusion.measured, rotation=25, ha="right")
        axes.grid(visible=False)
        axes.set_xlabel("measured class")
        axes.set_ylabel("commanded class")
        axes.set_title(f"Measured {summary.method.upper()} class of commanded drivers, % of row")
    return figure


def rank_note(summary: LabelSummary) -> str:
    """How knob and measured aggressiveness go together, and what to hold it against (REFERENCE section 1)."""
    rank = summary.confusion.knob_rank_correlation if summary.confusion else float("nan")
    if not np.isfinite(rank):
        return ""
    low, high = RANK_CEILING
    ceiling = (
        f"; between ranks of classes even perfect classes reach only {low} to {high}"
        if summary.method == "tdbm"
        else ""
    )
    return f"Spearman between the commanded knob and the measured aggressiveness: {rank:.2f}{ceiling}."


def stop_probability_figure(found: Approaches) -> Figure:
    """Who stopped before the line, by time to it at the onset of yellow and commanded style.

    Every approach is a tick, who stopped above, who went below, one row per style; the points are shares of all
    styles together in bins, with Wilson 95 % intervals.
    """
    k, m = NEUTRAL_YELLOW
    style = np.array(found.style, dtype=object)
    with drawing():
        figure, (axes,) = new_figure(WIDTH, 4.4)
        fine = np.linspace(0, MAX_TTS_S, 200)
        neutral = f"literature (k {k} 1/s, m {m} s)"
        axes.plot(fine, expit(k * (fine - m)), color=UNJUDGED_COLOUR, ls="--", lw=1.4, label=neutral)
        _pooled(axes, found)
        present = [name for name in (*STYLE_CLASSES, "neutral") if (style == name).any()]
        for row, name in enumerate(present, start=1):
            tts, stopped = found.tts_s[style == name], found.stopped[style == name]
            place = np.where(stopped, 1.0 + ROW * row, -ROW * row)
            axes.scatter(tts, place, marker="|", s=26, color=style_colour(name), label=f"{name}, n = {len(tts)}")
        axes.set_xlim(0, MAX_TTS_S)
        axes.set_ylim(-ROW * (len(present) + 1), 1 + ROW * (len(present) + 1))
        axes.set_yticks(np.linspace(0, 1, 6))
        axes.set_xlabel("time to the stop line at the onset of yellow (s)")
        axes.set_ylabel("share that stops before the line")
        axes.set_title("Stopped (ticks above) or went (below) at the yellow, by commanded style")
        figure.legend(loc="outside lower center", ncols=4)
    return figure


def _pooled(axes: Axes, found: Approaches) -> None:
    """Shares of all styles together, in bins of at least PER_POINT approaches."""
    place = np.floor(found.tts_s / TTS_BIN_S)
    bins = [place == number for number in range(int(MAX_TTS_S / TTS_BIN_S)) if (place == number).sum() >= PER_POINT]
    if not bins:
        return
    tests = [binomtest(int(found.stopped[b].sum()), int(b.sum())) for b in bins]
    share = np.array([test.statistic for test in tests])
    ends = np.array([test.proportion_ci(method="wilson") for test in tests])
    middle = [found.tts_s[b].mean() for b in bins]
    label = f"all styles, {TTS_BIN_S:g} s bins"
    error = [share - ends[:, 0], ends[:, 1] - share]
    axes.errorbar(middle, share, yerr=np.maximum(error, 0), fmt="o", ms=4.5, lw=1.2, color="#1f2933", label=label)
