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
    DatasetFormat(
        name="interaction",
        module="stylesim.datasets.interaction",
        description="INTERACTION: intersections, merges and roundabouts of several countries, with maps (CSV)",
        supports="vehicle_tracks_*.csv, pedestrian_tracks_*.csv and <site>.osm (lanelet2) of version 1",
        rate_hz=10.0,
        has_map=True,
        has_signals=False,
        licence="non-commercial, on request",
        where="https://interaction-dataset.com",
        options=("scene_s", "map"),
        numbers=("scene_s",),
    ),
    DatasetFormat(
        name="taf_bw",
        module="stylesim.datasets.taf_bw",
        description="TAF-BW: signalised and other intersections in Karlsruhe, tracked from the roadside (CSV)",
        supports="vehicle_tracks_*.csv, meta_data.csv, <site>.osm (lanelet2), signal_phases_*.csv where there is one",
        rate_hz=10.0,
        has_map=True,
        has_signals=True,
        licence="CC BY-NC-SA 4.0",
        where="https://github.com/fzi-forschungszentrum-informatik/test-area-autonomous-driving-dataset",
        options=("scene_s", "map"),
        numbers=("scene_s",),
    ),
)
