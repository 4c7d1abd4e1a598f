"""Corpora in the files that other frameworks read; `export` is the way in."""

from stylesim.exporting.export import export as export
