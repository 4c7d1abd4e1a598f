"""The semantic map of the Lyft data set: `semantic_map/semantic_map.pb`, a MapFragment, and `meta.json` beside it.

By l5kit's road_network.proto, whose numbers of fields stand below; read without protobuf. A lane is the area between
its boundaries, in centimetres in a frame of its own on the Earth; `meta.json` has the matrix from the recordings' frame
to earth-centred coordinates. Left out: lanes for bicycles only, segments and nodes as such, signs but stop and yield.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stylesim.datasets import wire
from stylesim.datasets.guarding import bounded, reading
from stylesim.datasets.json_files import json_document
from stylesim.datasets.lyft_elements import CONTROL, JUNCTION, LANE, SEGMENT, Elements
from stylesim.datasets.maps.city import CityMap
from stylesim.datasets.maps.shapes import aligned, between, distinct
from stylesim.datasets.polylines import stop_line_at
from stylesim.errors import InputError
from stylesim.road import Lane
from stylesim.signals import SignalState

MAX_FILE_BYTES = 1 << 30  # chosen: the published map has some 10 MB
ONLY_BIKE = 4  # AccessRestriction.Type
# Fields of TrafficControlElement: faces by colour (round, arrows, U-turn), and what else makes one stop.
FACES = {
    **dict.fromkeys((11, 30, 32, 38, 41, 44), SignalState.RED),
    **dict.fromkeys((12, 36, 37, 39, 42, 45), SignalState.YELLOW),
    **dict.fromkeys((13, 31, 33, 40, 43, 46), SignalState.GREEN),
    **dict.fromkeys((9, 10), SignalState.UNKNOWN),  # flashing: like a sign, not by time
}
STOP_SIGN, YIELD_SIGN, CROSSWALK, LIGHT, STOP_LINE = 7, 8, 16, 29, 47
MAX_LIMIT_MPS = 60.0  # 216 km/h


@dataclass(frozen=True, eq=False)
class LyftMap:
    """The lanes, and which faces of lights control the exit of each."""

    city: CityMap
    colour: Mapping[str, SignalState]  # of each face
    faces_of_lane: Mapping[str, tuple[str, ...]]


def lyft_map(file: Path) -> LyftMap:
    """The map in that file. InputError where it or its `meta.json` is missing, damaged, or none."""
    bounded(file, MAX_FILE_BYTES)
    meta = next((p / "meta.json" for p in (file.parent, file.parent.parent) if (p / "meta.json").is_file()), None)
    if meta is None:
        raise InputError(f"{file} has no meta.json beside it or one folder above; it says where on Earth the map is")
    with reading(meta, "meta.json of Lyft"):
        matrix = np.array(json_document(meta, limit_bytes=1 << 20)["world_to_ecef"], np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError("world_to_ecef is no matrix of four by four numbers")
        to_world = np.linalg.inv(matrix)
    with reading(file, "semantic map of Lyft"):
        return _Map(file.read_bytes(), to_world).map(file)


class _Map(Elements):
    """The lanes among the elements."""

    def map(self, file: Path) -> LyftMap:
        """All lanes; those without two boundaries are counted and left out."""
        controls = self.of_kind[CONTROL]
        colour = {name: state for name, one in controls.items() for field, state in FACES.items() if one.get(field)}
        lanes, faces, incomplete = [], {}, 0
        for name, lane in sorted(self.of_kind[LANE].items()):
            if self._access(lane) == ONLY_BIKE:
                continue
            sides = self._sides(lane)
            if sides is None:
                incomplete += 1
                continue
            faces[name] = self._faces(lane, colour)
            lanes.append(self._lane(name, lane, sides, controls, bool(faces[name])))
        if not lanes:
            raise InputError(f"{file} holds no lane; it is no semantic map of Lyft")
        known = {lane.lane_id for lane in lanes}
        walks = [self.outline(one) for _, one in sorted(controls.items()) if one.get(CROSSWALK)]
        return LyftMap(
            city=CityMap(
                lanes=tuple(_known(lane, known) for lane in lanes),
                crosswalks_m=tuple(walk for walk in walks if len(walk) >= 3),
                origin_m=np.zeros(2),
                incomplete=incomplete,
            ),
            colour=colour,
            faces_of_lane={name: found for name, found in faces.items() if found},
        )

    def _access(self, lane: wire.Fields) -> int:
        restriction = wire.spans(lane, 11)
        return wire.integer(wire.fields(self.data, restriction[-1]), 1) if restriction else 0

    def _sides(self, lane: wire.Fields) -> tuple[np.ndarray, np.ndarray] | None:
        """The left and the right boundary in driving direction: that in which the left one is on the left."""
        found = [wire.spans(lane, number) for number in (3, 4)]
        if not (found[0] and found[1] and lane.get(2)):
            return None
        frame = wire.fields(self.data, wire.spans(lane, 2)[-1])
        lines = [self.points(wire.fields(self.data, spans[-1]), frame, (1, 2, 3)) for spans in found]
        try:
            left, right, _, _ = aligned(distinct(lines[0]), distinct(lines[1]))
        except ValueError:  # a boundary without length
            return None
        return left, right

    def _faces(self, lane: wire.Fields, colour: Mapping[str, SignalState]) -> tuple[str, ...]:
        """The faces among a lane's controls, those of whole lights included."""
        found: dict[str, None] = {}
        for name in self.ids(lane, 8):
            light = self.of_kind[CONTROL].get(name, {}).get(LIGHT)
            inside = self.ids(wire.fields(self.data, light[-1]), 3) if light else [name]
            found |= dict.fromkeys(face for face in inside if face in colour)
        return tuple(sorted(found))

    def _lane(
        self,
        name: str,
        lane: wire.Fields,
        sides: tuple[np.ndarray, np.ndarray],
        controls: Mapping[str, wire.Fields],
        lit: bool,
    ) -> Lane:
        centre, width = between(*sides)
        own = [controls[i] for i in self.ids(lane, 8) if i in controls]
        painted = [self.outline(one) for one in own if one.get(STOP_LINE)]
        stop = None
        if painted and len(painted[0]):
            stop = stop_line_at(painted[0].mean(axis=0), centre.astype(np.float32), width)
        elif lit or any(one.get(STOP_SIGN) or one.get(YIELD_SIGN) for one in own):
            stop = np.stack([sides[0][-1], sides[1][-1]])  # "the exit boundary of the lane"
        parent = self.ids(lane, 1)
        segment = self.of_kind[SEGMENT].get(parent[0], {}) if parent else {}
        limit = wire.real(self.data, segment, 9)
        left, right = self.ids(lane, 6), self.ids(lane, 7)
        return Lane(
            lane_id=name,
            centre_line_m=centre.astype(np.float32),
            width_m=width,
            speed_limit_mps=limit if 0 < limit < MAX_LIMIT_MPS else float("nan"),
            left_boundary_m=sides[0].astype(np.float32),
            right_boundary_m=sides[1].astype(np.float32),
            successors=tuple(dict.fromkeys(self.ids(lane, 5))),
            left_neighbour=left[0] if left else "",
            right_neighbour=right[0] if right else "",
            in_junction=bool(parent) and parent[0] in self.of_kind[JUNCTION],
            stop_line_m=stop,
        )


def _known(lane: Lane, known: set[str]) -> Lane:
    return replace(
        lane,
        successors=tuple(i for i in lane.successors if i in known),
        left_neighbour=lane.left_neighbour if lane.left_neighbour in known else "",
        right_neighbour=lane.right_neighbour if lane.right_neighbour in known else "",
    )
