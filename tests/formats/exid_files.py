"""A data set in the format of exid, written by the tests."""

from __future__ import annotations

from pathlib import Path

from tests.formats import levelx_files


def sample(folder: Path) -> Path:
    """See `levelx_files`."""
    return levelx_files.sample(folder, "exid")
