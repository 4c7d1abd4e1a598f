"""Formats of recordings by drone, camera or radar beside the road, of scenario archives, and of plain tables."""

from stylesim.datasets.format import DatasetFormat

FORMATS = (
    DatasetFormat(
        name="dlr_ut",
        module="stylesim.datasets.dlr_ut",
        description="DLR Urban Traffic: signalised intersection in Braunschweig, boxes and lights (CSV)",
        supports="trajectories_*.csv[.gz] of version 1.2 with traffic-lights_*.csv[.gz] beside it",
        rate_hz=20.0,
        has_map=False,
        has_signals=True,
        licence="CC BY 4.0",
        where="https://doi.org/10.5281/zenodo.15754836",
        options=("scene_s", "road"),
        numbers=("scene_s",),
    ),
)
