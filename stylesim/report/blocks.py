"""What a page is made of: sections of blocks."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.figure import Figure

from stylesim.report.tables import Table
from stylesim.report.theme import data_uri


@dataclass(frozen=True)
class Block:
    """A figure (`image`), a table, or folded raw text, with its caption."""

    heading: str = ""
    image: str = ""
    caption: str = ""
    table: Table | None = None
    raw: str = ""
    fold: bool = False  # a table that is opened by a click


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    anchor: str
    title: str
    text: tuple[str, ...]
    blocks: tuple[Block, ...]


def picture(figure: Figure | None, caption: str, *, heading: str = "", raster: bool = False) -> list[Block]:
    """A block of that figure; none where there is no figure."""
    return [] if figure is None else [Block(heading, data_uri(figure, raster=raster), caption)]
