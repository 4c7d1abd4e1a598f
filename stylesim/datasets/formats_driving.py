"""Formats of data sets that were recorded from vehicles, mostly for forecasting benchmarks."""

from stylesim.datasets.format import DatasetFormat

FORMATS = (
    DatasetFormat(
        name="av2",
        module="stylesim.datasets.av2",
        description="Argoverse 2 motion forecasting: 11 s scenarios of six US cities with map (Parquet, JSON)",
        supports="scenario_<id>.parquet of 16 or 18 columns with log_map_archive_<id>.json; train, val, test",
        rate_hz=10.0,
        has_map=True,
        has_signals=False,
        licence="CC BY-NC-SA 4.0",
        where="https://www.argoverse.org/av2.html",
    ),
)
