"""Numbers with units, as maps and signs write them."""

from __future__ import annotations

import math
import re

MPS_PER_MPH = 0.44704  # by definition
MPS_PER_KMH = 1 / 3.6
M_PER_FOOT = 0.3048  # by definition (international foot)

_NUMBER = re.compile(r"^\s*([0-9]+(?:\.[0-9]+)?)\s*([a-zA-Z/]*)\s*$")
_FACTORS = {
    "": MPS_PER_KMH,  # OpenStreetMap and lanelet2: a bare number is km/h
    "kmh": MPS_PER_KMH,
    "km/h": MPS_PER_KMH,
    "kph": MPS_PER_KMH,
    "mph": MPS_PER_MPH,
    "m/s": 1.0,
    "mps": 1.0,
}


def speed_mps(text: str | None, *, bare: str = "km/h") -> float:
    """A speed such as "50", "30 mph" or "13.9m/s" in m/s, a bare number in `bare`; NaN where it is none."""
    match = _NUMBER.match(text or "")
    factor = _FACTORS.get(match.group(2).lower() or bare) if match else None
    if match is None or factor is None:
        return math.nan
    return float(match.group(1)) * factor
