"""Colours and type of every figure, and how a figure becomes part of a page.

The six classes have the colours of Okabe and Ito (2008, "Color Universal Design") [recalled], which people with any of
the common colour deficiencies can tell apart; warm is bold, cool is calm, and every class has a marker of its own, so
that no figure rests on colour alone. Forecasters have Paul Tol's "high contrast" colours [recalled], which differ in
lightness as well.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

STYLE_COLOUR = {
    "aggressive": "#D55E00",
    "reckless": "#E69F00",
    "threatening": "#CC79A7",
    "careful": "#009E73",
    "cautious": "#56B4E9",
    "timid": "#0072B2",
    "normal": "#0072B2",  # KDSC has two classes: aggressive and normal
    "neutral": "#666666",
}
STYLE_MARKER = {
    "aggressive": "^",
    "reckless": "D",
    "threatening": "s",
    "careful": "o",
    "cautious": "P",
    "timid": "v",
    "normal": "o",
    "neutral": "X",
}
UNJUDGED_COLOUR = "#8F979E"  # undetermined
UNKNOWN_COLOUR = "#C3CAD1"  # nobody judged or commanded it
SERIES_COLOUR = ("#004488", "#BB5566", "#DDAA33", "#444444", "#66A5AD", "#8E6C8A")
SERIES_MARKER = ("o", "s", "D", "^", "v", "P")
INK, FAINT, SURFACE = "#1F2933", "#D9DEE3", "#EEF1F4"

_RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "text.parse_math": False,  # names come from data: a "$" in one is no formula
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#8A949E",
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "path",
    "svg.hashsalt": "stylesim",
    "figure.facecolor": "white",
}


@contextmanager
def drawing() -> Iterator[None]:
    """The look of the report while a figure is made; the user's own settings come back afterwards."""
    with mpl.rc_context(_RC):
        yield


def new_figure(width: float, height: float, *, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of that many inches with `columns` axes side by side; not registered with pyplot."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(figure.subplots(1, columns, squeeze=False)[0])


def style_colour(name: str) -> str:
    """The colour of a class; greys for "undetermined" and for what is no class."""
    return UNJUDGED_COLOUR if name == "undetermined" else STYLE_COLOUR.get(name, UNKNOWN_COLOUR)


def style_marker(name: str) -> str:
    """The marker of a class; a cross for what is no class."""
    return STYLE_MARKER.get(name, "x")


def plural(count: int, noun: str) -> str:
    """`1 unit`, `2 units`."""
    return f"{count} {noun}" + ("" if count == 1 else "s")


def figure_bytes(figure: Figure, *, raster: bool = False) -> bytes:
    """The figure as SVG, or as PNG (`raster`) where it has thousands of dots; deterministic."""
    buffer = io.BytesIO()
    with drawing():
        if raster:
            figure.savefig(buffer, format="png", dpi=160, metadata={"Software": None})
        else:
            figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    return buffer.getvalue()


def data_uri(figure: Figure, *, raster: bool = False) -> str:
    """The figure as a `data:` address for an <img>."""
    kind = "image/png" if raster else "image/svg+xml"
    return f"data:{kind};base64,{base64.b64encode(figure_bytes(figure, raster=raster)).decode('ascii')}"
