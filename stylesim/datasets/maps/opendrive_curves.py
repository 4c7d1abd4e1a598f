"""The plan view of OpenDRIVE roads (lines, arcs, spirals, cubics), and the cubics of widths and offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float64

# Gauss-Legendre nodes: over a metre of any road's spiral the error is below a nanometre.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_ARC_STEPS = 200  # chosen: a cubic of 100 m is measured every half a metre to find its arc length


@dataclass(frozen=True)
class Cubics:
    """Piecewise cubics: piece i holds from `start[i]` on, in the distance from there; 0 before the first."""

    start: tuple[float, ...]
    coefficients: tuple[tuple[float, float, float, float], ...]

    @classmethod
    def of(cls, elements: Sequence[Element], position: str) -> Cubics:
        """From elements with a, b, c, d and their start in the attribute `position`. ValueError for no number."""
        rows = sorted((_number(e, position), tuple(_number(e, k) for k in "abcd")) for e in elements)
        return cls(tuple(r[0] for r in rows), tuple(r[1] for r in rows))  # type: ignore[misc]

    def at(self, s: Float64[np.ndarray, " s"]) -> Float64[np.ndarray, " s"]:
        """Values at the distances `s`."""
        if not self.start:
            return np.zeros(len(s))
        piece = np.searchsorted(np.array(self.start), s + 1e-9, side="right") - 1
        a, b, c, d = np.array(self.coefficients)[np.maximum(piece, 0)].T
        ds = s - np.array(self.start)[np.maximum(piece, 0)]
        return np.asarray(np.where(piece >= 0, a + ds * (b + ds * (c + ds * d)), 0.0))


@dataclass(frozen=True, eq=False)
class Plan:
    """A reference line: its pieces as (start, length, x, y, heading, element of the shape)."""

    pieces: tuple[tuple[float, float, float, float, float, Element], ...]

    @classmethod
    def of(cls, road: Element) -> Plan:
        """The plan view of a road. ValueError where there is none, or a number is none."""
        pieces = []
        for geometry in road.findall("planView/geometry"):
            shape = next(iter(geometry), None)
            if shape is None:
                raise ValueError("a geometry has no shape")
            s, length, x, y, hdg = (_number(geometry, name) for name in ("s", "length", "x", "y", "hdg"))
            if length > 0:
                pieces.append((s, length, x, y, hdg, shape))
        if not pieces:
            raise ValueError("a road has no geometry")
        return cls(tuple(sorted(pieces, key=lambda piece: piece[0])))

    @property
    def starts(self) -> tuple[float, ...]:
        """Where pieces begin: stations worth sampling."""
        return tuple(piece[0] for piece in self.pieces)

    def at(self, s: Float64[np.ndarray, " s"]) -> tuple[Float64[np.ndarray, "s 2"], Float64[np.ndarray, " s"]]:
        """Places and directions (rad) at ascending distances along the line."""
        piece = np.clip(np.searchsorted(np.array(self.starts), s + 1e-9, side="right") - 1, 0, len(self.pieces) - 1)
        place, direction = np.zeros((len(s), 2)), np.zeros(len(s))
        for i in np.unique(piece).tolist():
            start, length, x, y, hdg, shape = self.pieces[i]
            here = piece == i
            u, v, turn = _shape(shape, np.clip(s[here] - start, 0.0, length), length)
            cos, sin = np.cos(hdg), np.sin(hdg)
            place[here] = np.stack([x + cos * u - sin * v, y + sin * u + cos * v], axis=1)
            direction[here] = hdg + turn
        return place, direction


_Local = tuple[Float64[np.ndarray, " s"], Float64[np.ndarray, " s"], Float64[np.ndarray, " s"]]


def _shape(shape: Element, s: Float64[np.ndarray, " s"], length: float) -> _Local:
    """Along, across and turned at distances from the piece's start, in its own frame."""
    if shape.tag == "line":
        return s, np.zeros(len(s)), np.zeros(len(s))
    if shape.tag == "arc":
        curvature = _number(shape, "curvature")
        return _clothoid(s, curvature, 0.0)
    if shape.tag == "spiral":
        first, last = _number(shape, "curvStart"), _number(shape, "curvEnd")
        return _clothoid(s, first, (last - first) / length)
    if shape.tag == "poly3":
        a, b, c, d = (_number(shape, k) for k in "abcd")
        u = _by_arc_length(np.array([0.0, 1.0, 0.0, 0.0]), np.array([a, b, c, d]), s, length)
        return u, a + u * (b + u * (c + u * d)), np.arctan(b + u * (2 * c + 3 * u * d))
    if shape.tag == "paramPoly3":
        along = np.array([_number(shape, k + "U") for k in "abcd"])
        across = np.array([_number(shape, k + "V") for k in "abcd"])
        # pRange "arcLength": the parameter is the distance; "normalized" (and by default): from 0 to 1.
        p = s if shape.get("pRange") == "arcLength" else s / length
        power = np.stack([p**k for k in range(4)])
        slope = np.stack([k * p ** max(k - 1, 0) for k in range(4)])
        return along @ power, across @ power, np.arctan2(across @ slope, along @ slope)
    raise ValueError(f"a geometry of the unknown shape {shape.tag!r}")


def _clothoid(s: Float64[np.ndarray, " s"], curvature: float, change: float) -> _Local:
    """Curvature grows by `change` per metre; integrated piece by piece."""
    knots = np.concatenate([[0.0], s])
    half = np.diff(knots)[:, None] / 2
    at = knots[:-1, None] + half * (_NODES + 1)
    angle = curvature * at + change * at**2 / 2
    u = np.cumsum((np.cos(angle) * _WEIGHTS * half).sum(axis=1))
    v = np.cumsum((np.sin(angle) * _WEIGHTS * half).sum(axis=1))
    return u, v, curvature * s + change * s**2 / 2


def _by_arc_length(
    u: Float64[np.ndarray, "4"], v: Float64[np.ndarray, "4"], s: Float64[np.ndarray, " s"], length: float
) -> Float64[np.ndarray, " s"]:
    """The parameter at which a cubic has gone the distance s."""
    p = np.linspace(0.0, length, _ARC_STEPS + 1)
    power = np.stack([p**k for k in range(4)])
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u @ power), np.diff(v @ power)))])
    return np.asarray(np.interp(s, gone, p))


def _number(element: Element, name: str) -> float:
    value = float(element.get(name, "nan"))
    if not np.isfinite(value) or abs(value) > 1e9:
        raise ValueError(f"<{element.tag}> has no usable number {name!r} ({element.get(name)!r})")
    return value
