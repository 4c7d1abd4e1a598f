"""Local frames on the Earth (GeoFrame of l5kit's road_network.proto) to earth-centred coordinates on WGS 84."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from stylesim.datasets import wire

_A_M, _F = 6378137.0, 1 / 298.257223563  # WGS 84, by definition
_E2 = _F * (2 - _F)


@dataclass(frozen=True)
class Frame:
    """A plane that touches the ellipsoid; `bearing_deg` is clockwise from north to its y axis."""

    latitude_deg: float
    longitude_deg: float
    bearing_deg: float = 0.0

    @classmethod
    def of(cls, data: bytes, frame: wire.Fields) -> Frame:
        """From a GeoFrame message; ValueError where it has no origin on Earth."""
        origin = wire.spans(frame, 1)
        place = wire.fields(data, origin[-1]) if origin else {}
        latitude, longitude = (_fixed(data, place, number) / 1e7 for number in (1, 2))
        if not (abs(latitude) <= 90 and abs(longitude) <= 180):
            raise ValueError(f"a frame lies at {latitude}, {longitude} degrees")
        return cls(latitude, longitude, wire.real(data, frame, 2, 0.0))

    def to_earth(self, points_m: Float64[np.ndarray, "point 3"]) -> Float64[np.ndarray, "point 3"]:
        """Points of the frame (m) in earth-centred, earth-fixed coordinates (m), as the comments of GeoFrame say."""
        phi, lam, bearing = np.radians([self.latitude_deg, self.longitude_deg, self.bearing_deg])
        up = np.array([np.cos(lam) * np.cos(phi), np.sin(lam) * np.cos(phi), np.sin(phi)])
        east = np.array([-np.sin(lam), np.cos(lam), 0.0])
        north = np.cross(up, east)
        x = np.cos(bearing) * east - np.sin(bearing) * north
        y = np.sin(bearing) * east + np.cos(bearing) * north
        normal = _A_M / np.sqrt(1 - _E2 * np.sin(phi) ** 2)
        origin = normal * up * np.array([1.0, 1.0, 1 - _E2])
        return np.asarray(origin + points_m @ np.stack([x, y, up]))


def _fixed(data: bytes, message: wire.Fields, number: int) -> int:
    """A field of type sfixed32; 0 where it is missing."""
    found = wire.spans(message, number)
    if not found:
        return 0
    start, end = found[-1]
    if end - start != 4:
        raise wire.WireError(f"field {number} is no sfixed32")
    return int(struct.unpack("<i", data[start:end])[0])
