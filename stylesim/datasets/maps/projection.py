"""From degrees to metres: the UTM projection on WGS 84, and the local frames that recordings count from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

# latitudes, longitudes (degrees) -> x, y (m)
Projector = Callable[[Float64[np.ndarray, " point"], Float64[np.ndarray, " point"]], Float64[np.ndarray, "point 2"]]

# WGS 84 and UTM, by definition.
_A_M, _F = 6378137.0, 1 / 298.257223563
_SCALE, _FALSE_EASTING_M, _FALSE_NORTHING_M = 0.9996, 500_000.0, 10_000_000.0
_N = _F / (2 - _F)
_RADIUS_M = _A_M / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64 + _N**6 / 256)
# Krüger's series, as in Karney 2011, "Transverse Mercator with an accuracy of a few nanometers", eq. (35).
_ALPHA = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16 + 41 * _N**4 / 180,
    13 * _N**2 / 48 - 3 * _N**3 / 5 + 557 * _N**4 / 1440,
    61 * _N**3 / 240 - 103 * _N**4 / 140,
    49561 * _N**4 / 161280,
)


def utm_zone(longitude_deg: float) -> int:
    """The zone of six degrees, 1 to 60; the exceptions around Norway and Svalbard are not made."""
    return int(np.clip(np.floor((longitude_deg + 180.0) / 6.0), 0, 59)) + 1


def utm(
    latitude_deg: Float64[np.ndarray, " point"],
    longitude_deg: Float64[np.ndarray, " point"],
    *,
    zone: int,
    south: bool = False,
) -> Float64[np.ndarray, "point 2"]:
    """Easting and northing (m) in a zone, to better than a micrometre within it."""
    phi = np.radians(latitude_deg)
    lam = np.radians(longitude_deg - (6 * zone - 183))
    e = 2 * np.sqrt(_N) / (1 + _N)
    t = np.sinh(np.arctanh(np.sin(phi)) - e * np.arctanh(e * np.sin(phi)))
    xi = np.arctan2(t, np.cos(lam))
    eta = np.arctanh(np.sin(lam) / np.hypot(1.0, t))
    x, y = eta.copy(), xi.copy()
    for j, alpha in enumerate(_ALPHA, start=1):
        x += alpha * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
        y += alpha * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
    easting = _FALSE_EASTING_M + _SCALE * _RADIUS_M * x
    northing = _SCALE * _RADIUS_M * y + (_FALSE_NORTHING_M if south else 0.0)
    return np.stack([easting, northing], axis=1)


def from_origin(latitude_deg: float, longitude_deg: float) -> Projector:
    """Metres from a place, along the axes of its UTM zone: the frame of lanelet2's own UTM projector.

    INTERACTION and SinD put that place at 0, 0 degrees.
    """
    zone = utm_zone(longitude_deg)
    place = utm(np.array([latitude_deg]), np.array([longitude_deg]), zone=zone)

    def project(
        latitude: Float64[np.ndarray, " point"], longitude: Float64[np.ndarray, " point"]
    ) -> Float64[np.ndarray, "point 2"]:
        return utm(latitude, longitude, zone=zone) - place

    return project


def mercator_from(latitude_deg: float, longitude_deg: float) -> Projector:
    """Metres from a place in a spherical Mercator projection scaled to its latitude: the frame of TAF-BW [read]."""
    radius = _A_M * np.cos(np.radians(latitude_deg))

    def north(latitude: Float64[np.ndarray, " point"]) -> Float64[np.ndarray, " point"]:
        return np.arcsinh(np.tan(np.radians(latitude)))

    def project(
        latitude: Float64[np.ndarray, " point"], longitude: Float64[np.ndarray, " point"]
    ) -> Float64[np.ndarray, "point 2"]:
        x = radius * np.radians(longitude - longitude_deg)
        y = radius * (north(latitude) - north(np.array([latitude_deg])))
        return np.stack([x, y], axis=1)

    return project


def from_utm_origin(easting_m: float, northing_m: float) -> Projector:
    """Metres from a place that is given in the UTM zone of the points themselves: the frame of levelXData."""

    def project(
        latitude: Float64[np.ndarray, " point"], longitude: Float64[np.ndarray, " point"]
    ) -> Float64[np.ndarray, "point 2"]:
        zone = utm_zone(float(np.median(longitude))) if len(longitude) else 1
        south = bool(len(latitude) and np.median(latitude) < 0)
        return utm(latitude, longitude, zone=zone, south=south) - np.array([easting_m, northing_m])

    return project
