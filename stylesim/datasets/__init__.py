"""Readers of recorded data: one module per foreign format, and `read`, which turns any of them into a corpus.

A reader is a module with `scenes(path, **options) -> Iterator[Scene]` and `sniff(path) -> bool`, listed in
`formats_driving` or `formats_recorded`. It may use `recording.Recording` (a long table, one row per road user and
frame) and `cutting.cut`, or `dense.checked_tracks` (arrays by agent and frame); what it drops it counts.
"""

from stylesim.datasets.format import DatasetFormat as DatasetFormat
from stylesim.datasets.formats import FORMATS as FORMATS
from stylesim.datasets.reading import read as read
