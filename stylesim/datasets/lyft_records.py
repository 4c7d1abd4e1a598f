"""The records and labels of the Lyft data set (l5kit's description of its zarr format)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from stylesim.datasets.guarding import bounded
from stylesim.errors import InputError
from stylesim.tracks import AgentKind

N_LABELS = 17
SCENE = np.dtype([("frame_index_interval", "<i8", (2,)), ("host", "<U16"), ("start_time", "<i8"), ("end_time", "<i8")])
FRAME = np.dtype(
    [
        ("timestamp", "<i8"),
        ("agent_index_interval", "<i8", (2,)),
        ("traffic_light_faces_index_interval", "<i8", (2,)),
        ("ego_translation", "<f8", (3,)),
        ("ego_rotation", "<f8", (3, 3)),
    ]
)
AGENT = np.dtype(
    [
        ("centroid", "<f8", (2,)),
        ("extent", "<f4", (3,)),
        ("yaw", "<f4"),
        ("velocity", "<f4", (2,)),
        ("track_id", "<u8"),
        ("label_probabilities", "<f4", (N_LABELS,)),
    ]
)
KINDS = {
    "PERCEPTION_LABEL_CAR": AgentKind.CAR,
    "PERCEPTION_LABEL_VAN": AgentKind.CAR,
    "PERCEPTION_LABEL_BUS": AgentKind.BUS,
    "PERCEPTION_LABEL_TRUCK": AgentKind.TRUCK,
    "PERCEPTION_LABEL_EMERGENCY_VEHICLE": AgentKind.TRUCK,
    "PERCEPTION_LABEL_BICYCLE": AgentKind.BICYCLE,
    "PERCEPTION_LABEL_CYCLIST": AgentKind.BICYCLE,
    "PERCEPTION_LABEL_MOTORCYCLE": AgentKind.MOTORCYCLE,
    "PERCEPTION_LABEL_MOTORCYCLIST": AgentKind.MOTORCYCLE,
    "PERCEPTION_LABEL_PEDESTRIAN": AgentKind.PEDESTRIAN,
}  # everything else (unknown, tram, animal, …) is OTHER


def labels_of(store: Path) -> list[AgentKind]:
    """The kind behind each label probability, by the labels that the store lists."""
    listed = json.loads(bounded(store / ".zattrs", 1 << 20).read_bytes()).get("labels")
    if not isinstance(listed, list) or len(listed) != N_LABELS:
        raise InputError(f"{store} lists no {N_LABELS} labels in .zattrs")
    return [KINDS.get(str(label), AgentKind.OTHER) for label in listed]
