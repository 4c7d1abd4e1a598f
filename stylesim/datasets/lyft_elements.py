"""The elements of a MapFragment of l5kit's road_network.proto, by kind and id."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64, Int64

from stylesim.datasets import wire
from stylesim.datasets.maps.earth import Frame
from stylesim.datasets.polylines import MAX_MAP_M

SEGMENT, LANE, CONTROL, JUNCTION = 1, 3, 4, 5  # fields of MapElement.Element


class Elements:
    """The elements of a fragment by their ids."""

    def __init__(self, data: bytes, to_world: Float64[np.ndarray, "4 4"]) -> None:
        self.data, self.to_world = data, to_world
        self.of_kind: dict[int, dict[str, wire.Fields]] = {SEGMENT: {}, LANE: {}, CONTROL: {}, JUNCTION: {}}
        for span in wire.spans(wire.fields(data, (0, len(data))), 2):
            element = wire.fields(data, span)
            name = self.ids(element, 1)
            content = wire.fields(data, wire.spans(element, 2)[-1]) if element.get(2) else {}
            for kind, found in self.of_kind.items():
                if name and content.get(kind):
                    found[name[0]] = wire.fields(data, wire.spans(content, kind)[-1])

    def ids(self, message: wire.Fields, number: int) -> list[str]:
        """The GlobalIds of a field, without empty ones."""
        found = (wire.text(self.data, wire.fields(self.data, span), 1) for span in wire.spans(message, number))
        return [name for name in found if name]

    def points(
        self, message: wire.Fields, frame: wire.Fields, numbers: tuple[int, int, int]
    ) -> Float64[np.ndarray, "point 2"]:
        """Deltas in centimetres in a frame, as points of the recordings' frame."""
        x, y, z = (_unzigzag(wire.integers(self.data, message, number)) for number in numbers)
        if not len(x) == len(y) or len(z) not in (0, len(x)):
            raise ValueError("a line has unequal numbers of coordinates")
        deltas = np.stack([x, y, z if len(z) else np.zeros(len(x), np.int64)], axis=-1)
        line = Frame.of(self.data, frame).to_earth(np.cumsum(deltas, axis=0) / 100.0)
        line = (line @ self.to_world[:3, :3].T + self.to_world[:3, 3])[:, :2]
        if not (np.abs(line) <= MAX_MAP_M).all():
            raise ValueError("a point of the map is not finite or too far away")
        return line

    def outline(self, control: wire.Fields) -> Float64[np.ndarray, "point 2"]:
        """The points of a traffic control element; none where it has no frame."""
        if not control.get(2):
            return np.zeros((0, 2))
        return self.points(control, wire.fields(self.data, wire.spans(control, 2)[-1]), (3, 4, 5))


def _unzigzag(values: Int64[np.ndarray, " value"]) -> Int64[np.ndarray, " value"]:
    """Signed numbers of a sint32 field."""
    return (values >> 1) ^ -(values & 1)
