"""How pages read the tables of an analysis without knowing what makes them."""

from __future__ import annotations

import polars as pl

Frame = pl.DataFrame


def where(table: Frame, **equal: str | float) -> Frame:
    """The rows whose columns have these values."""
    return table.filter(*[pl.col(column) == value for column, value in equal.items()])


def known(table: Frame, column: str) -> Frame:
    """The rows in which that column is known."""
    return table.filter(pl.col(column).is_not_null())
