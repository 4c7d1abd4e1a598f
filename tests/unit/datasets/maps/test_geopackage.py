import struct

import numpy as np
import pytest

from stylesim.datasets.maps.geopackage import MAX_POINTS, geometry

XY = [(1.0, 2.0), (3.0, 5.0), (8.0, 13.0)]


def line(points, *, order="<", kind=2, extra=()):
    head = struct.pack("B", order == "<") + struct.pack(order + "II", kind, len(points))
    return head + b"".join(struct.pack(f"{order}{2 + len(extra)}d", *point, *extra) for point in points)


def packed(body, *, envelope=0):
    sizes = {0: 0, 1: 32, 2: 48, 3: 48, 4: 64}
    return b"GP\x00" + bytes([1 | envelope << 1]) + struct.pack("<i", 4326) + bytes(sizes[envelope]) + body


@pytest.mark.parametrize("envelope", range(5))
@pytest.mark.parametrize("order", "<>")
def test_lines_in_both_byte_orders_behind_any_envelope(envelope, order):
    np.testing.assert_array_equal(geometry(packed(line(XY, order=order), envelope=envelope)), XY)


def test_heights_and_measures_are_left_out():
    for kind, extra in ((1002, (9.0,)), (2002, (7.0,)), (3002, (9.0, 7.0))):
        np.testing.assert_array_equal(geometry(packed(line(XY, kind=kind, extra=extra))), XY)


def test_an_area_is_its_outline_and_of_several_the_longest_counts():
    def ring(points):
        return struct.pack("<I", len(points)) + np.array(points).astype("<f8").tobytes()

    area = struct.pack("<BII", 1, 3, 2) + ring([*XY, XY[0]]) + ring([(0.0, 0.0)] * 9)
    np.testing.assert_array_equal(geometry(packed(area)), [*XY, XY[0]])
    many = struct.pack("<BII", 1, 6, 2) + struct.pack("<BII", 1, 3, 1) + ring(XY) + area
    np.testing.assert_array_equal(geometry(packed(many)), [*XY, XY[0]])
    both = struct.pack("<BII", 1, 5, 2) + line(XY[:2]) + line(XY, order=">")
    np.testing.assert_array_equal(geometry(packed(both)), XY)


@pytest.mark.parametrize(
    ("blob", "says"),
    [
        (b"", "does not begin"),
        ("GP and a text", "does not begin"),
        (None, "does not begin"),
        (packed(b""), "cut off"),
        (packed(line(XY))[:-1], "cut off"),
        (packed(struct.pack("<BII", 1, 2, 4000)), "cut off"),
        (packed(struct.pack("<BII", 1, 2, MAX_POINTS + 1)), "parts"),
        (packed(struct.pack("<BII", 1, 1, 0)), "neither line nor area"),
        (packed(struct.pack("<BII", 1, 5, 1) + struct.pack("<BII", 1, 5, 1)), "neither line nor area"),
        (packed(struct.pack("<BII", 1, 6, 0)), "empty"),
        (b"GP\x00\xff" + bytes(200), "cut off"),
    ],
)
def test_what_is_no_geometry_is_refused(blob, says):
    with pytest.raises(ValueError, match=says):
        geometry(blob)
