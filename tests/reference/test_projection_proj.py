"""Projections against PROJ 9.5.1 (pyproj 3.7.2): `Transformer.from_crs(4326, epsg)` and `+proj=merc`."""

import numpy as np
import pytest

from stylesim.datasets.maps.projection import from_utm_origin, mercator_from, utm, utm_zone


@pytest.mark.parametrize(
    ("latitude", "longitude", "epsg", "easting", "northing"),
    [
        (49.01160993928274, 8.43856470258739, 32632, 458944.841232, 5428898.241372),
        (52.27455, 10.52337, 32632, 603936.124710, 5792668.145393),
        (-33.865143, 151.2099, 32756, 334417.074523, 6251354.860008),
        (0.0092, 0.0093, 32631, 167057.729848, 1018.272648),
        (83.9, -179.99, 32601, 464542.799994, 9317850.302331),
        (50.78, 6.07, 32632, 293450.314552, 5629453.669165),
    ],
)
def test_utm(latitude, longitude, epsg, easting, northing):
    zone = utm_zone(longitude)
    assert zone == epsg % 100
    place = utm(np.array([latitude]), np.array([longitude]), zone=zone, south=latitude < 0)[0]
    np.testing.assert_allclose(place, [easting, northing], atol=2e-6)
    local = from_utm_origin(easting - 10, northing + 5)(np.array([latitude]), np.array([longitude]))[0]
    np.testing.assert_allclose(local, [10, -5], atol=2e-6)


def test_scaled_mercator():
    # +proj=merc +a=6378137 +b=6378137 +lat_ts=49.005306, the origin's own place subtracted
    place = mercator_from(49.005306, 8.4374089)(np.array([49.0060]), np.array([8.4390]))[0]
    np.testing.assert_allclose(place, [116.189085, 77.256265], atol=2e-6)
