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
    DatasetFormat(
        name="womd",
        module="stylesim.datasets.womd",
        description="Waymo Open Motion: 9 s scenarios with map and lights (TFRecord)",
        supports="*tfrecord* files of Scenario protos (all versions) or of tf.Example; checksums are verified",
        rate_hz=10.0,
        has_map=True,
        has_signals=True,
        licence="Waymo Dataset License (non-commercial)",
        where="https://waymo.com/open/download",
    ),
    DatasetFormat(
        name="gpudrive",
        module="stylesim.datasets.gpudrive",
        description="Waymo Open Motion as the JSON of GPUDrive and Nocturne",
        supports="one JSON file per scenario; headings in radians or degrees; lanes are linked where their ends meet",
        rate_hz=10.0,
        has_map=True,
        has_signals=True,
        licence="Waymo Dataset License (non-commercial)",
        where="https://huggingface.co/datasets/EMERGE-lab/GPUDrive",
    ),
    DatasetFormat(
        name="nuplan",
        module="stylesim.datasets.nuplan",
        description="nuPlan: logs of automated driving in four cities, with lights (SQLite)",
        supports="<log>.db of versions 1.0 and 1.1, cut into scenes; the separate map (GeoPackage) is not read",
        rate_hz=20.0,
        has_map=False,
        has_signals=True,
        licence="CC BY-NC-SA 4.0",
        where="https://www.nuscenes.org/nuplan",
        options=("scene_s",),
        numbers=("scene_s",),
    ),
)
