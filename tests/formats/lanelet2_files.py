"""A lanelet2 map of the tests' crossing, written by the tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

Inverse = Callable[[float, float], tuple[float, float]]  # metres -> latitude, longitude
_DEGREE_M = 111_319.49079327358  # of a great circle on a sphere of WGS 84's equatorial radius

# Two lanes east in two parts each, and one lane south that crosses the second part of both.
NODES = {
    1: (-100.0, -1.75), 2: (-100.0, 1.75), 3: (-100.0, 5.25), 4: (20.0, -1.75), 5: (20.0, 1.75), 6: (20.0, 5.25),
    7: (200.0, -1.75), 8: (200.0, 1.75), 9: (200.0, 5.25), 10: (42.0, 80.0), 11: (38.0, 80.0), 12: (42.0, -80.0),
    13: (38.0, -80.0), 14: (18.0, -1.75), 15: (18.0, 5.25), 16: (15.0, 8.0), 17: (15.0, 9.0),
}  # fmt: skip
WAYS = {  # the second boundary of the first lane is written backwards, as editors leave them
    101: ((1, 4), {"type": "line_thin"}), 102: ((5, 2), {"type": "line_thin"}), 103: ((3, 6), {"type": "curbstone"}),
    104: ((4, 7), {"type": "line_thin"}), 105: ((5, 8), {"type": "line_thin"}), 106: ((6, 9), {"type": "curbstone"}),
    107: ((10, 12), {"type": "virtual"}), 108: ((11, 13), {"type": "virtual"}), 109: ((14, 15), {"type": "stop_line"}),
    110: ((16, 17), {"type": "traffic_light", "name": "Traffic light 2"}),
}  # fmt: skip
LANELETS = {  # left, right, tags
    1001: (102, 101, {"subtype": "road"}), 1002: (103, 102, {}), 1003: (105, 104, {"subtype": "road"}),
    1004: (106, 105, {"subtype": "road", "speed_limit": "30 km/h"}), 1005: (107, 108, {"subtype": "road"}),
    1006: (103, 106, {"subtype": "walkway"}),
}  # fmt: skip


def near_origin(x: float, y: float) -> tuple[float, float]:
    """The place whose UTM frame from 0, 0 degrees has it at about x, y: within a metre over 200 m."""
    return y / _DEGREE_M / 0.9933 * 0.9996, x / _DEGREE_M * 0.9996


def mercator(latitude: float, longitude: float) -> Inverse:
    """The inverse of a spherical Mercator projection scaled to that latitude."""
    scale = 6378137.0 * np.cos(np.radians(latitude))
    north = np.arcsinh(np.tan(np.radians(latitude)))

    def inverse(x: float, y: float) -> tuple[float, float]:
        return float(np.degrees(np.arctan(np.sinh(north + y / scale)))), longitude + float(np.degrees(x / scale))

    return inverse


def osm(inverse: Inverse, *, limit: str = "50", extra: str = "") -> str:
    """The document; every lane has the regulatory element of a speed limit, the first two that of a light."""
    lines = ["<?xml version='1.0' encoding='UTF-8'?>", "<osm version='0.6' generator='test'>"]
    for node, (x, y) in NODES.items():
        lat, lon = inverse(x, y)
        lines.append(f"  <node id='{node}' visible='true' lat='{lat:.13f}' lon='{lon:.13f}' />")
    for way, (nodes, tags) in WAYS.items():
        lines.append(f"  <way id='{way}'>")
        lines += [f"    <nd ref='{node}' />" for node in nodes]
        lines += [*_tags(tags), "  </way>"]
    for lanelet, (left, right, tags) in LANELETS.items():
        lines.append(f"  <relation id='{lanelet}'>")
        lines.append(f"    <member type='way' ref='{left}' role='left' />")
        lines.append(f"    <member type='way' ref='{right}' role='right' />")
        lines.append("    <member type='relation' ref='2001' role='regulatory_element' />")
        lines += [*_tags({"type": "lanelet", "one_way": "yes", **tags}), "  </relation>"]
    limits = {"type": "regulatory_element", "subtype": "speed_limit", "sign_type": limit}
    lines += ["  <relation id='2001'>", *_tags(limits), "  </relation>"]
    lines.append("  <relation id='2002'><member type='way' ref='109' role='ref_line' />")
    lines.append("    <member type='way' ref='110' role='refers' />")
    lines += [*_tags({"type": "regulatory_element", "subtype": "traffic_light"}), "  </relation>"]
    return "\n".join([*lines, extra, "</osm>", ""])


def _tags(tags: dict[str, str]) -> list[str]:
    return [f"    <tag k='{k}' v='{v}' />" for k, v in tags.items()]


def write(path: Path, inverse: Inverse = near_origin, **options: str) -> Path:
    """The map as a file."""
    path.write_text(osm(inverse, **options))
    return path
