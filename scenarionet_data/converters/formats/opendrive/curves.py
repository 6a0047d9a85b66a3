"""Reference lines and polynomials of OpenDRIVE, evaluated at many stations at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

FINEST = 0.25
"""Distance between the stations at which a road is evaluated [m]."""
_LONGEST = 100_000.0
_FARTHEST = 1e8
"""Length of a road, and coordinate, beyond which a file is damaged [m]."""
_GAUSS = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)]), np.array([5.0, 8.0, 5.0]) / 18.0
"""Points and weights of Gauss and Legendre's integration over [0, 1]."""
_GRID = 8
"""Points of a polynomial's table of arc lengths for each metre."""


def number(element: Element, name: str, default: float | None = None) -> float:
    """Return an attribute as a number.

    Raises:
        ValueError: It is missing without a default, no number, not finite, or too large.
    """
    text = element.get(name)
    if text is None and default is not None:
        return default
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not abs(value) < _FARTHEST:
        raise ValueError(f"<{element.tag}>, {name}: expected a number, found {str(text)[:32]}")
    return value


@dataclass(frozen=True, eq=False)
class Cubics:
    """A function of the station in pieces a + b ds + c ds² + d ds³: starts (K,) [m] and coefficients (K, 4)."""

    starts: Float64
    coefficients: Float64

    @classmethod
    def read(cls, elements: Sequence[Element], start: str, offset: float = 0.0) -> Cubics:
        """Read pieces whose start is an attribute, relative to ``offset`` [m]."""
        rows = [[offset + number(each, start), *(number(each, key, 0.0) for key in "abcd")] for each in elements]
        table = np.array(sorted(rows), np.float64).reshape(-1, 5)
        return cls(table[:, 0], table[:, 1:])

    def at(self, stations: Float64) -> Float64:
        """Values (S,); 0 before the first piece."""
        if not len(self.starts):
            return np.zeros(len(stations))
        piece = np.searchsorted(self.starts, stations, side="right") - 1
        ds = stations - self.starts[piece]
        a, b, c, d = self.coefficients[piece].T
        return np.where(piece >= 0, a + ds * (b + ds * (c + ds * d)), 0.0)


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """A road's reference line at S stations.

    Attributes:
        stations: (S,) [m].
        points: (S, 2) [m].
        headings: (S,) [rad].
    """

    stations: Float64
    points: Float64
    headings: Float64

    @classmethod
    def read(cls, road: Element, breaks: Sequence[float]) -> ReferenceLine:
        """Evaluate a road's geometries every 0.25 m, and at ``breaks``.

        Raises:
            ValueError: A geometry or length that cannot be.
        """
        length, geometries = number(road, "length"), road.findall("planView/geometry")
        if not (0.0 < length <= _LONGEST and geometries):
            raise ValueError(f"expected geometries and a length up to {_LONGEST:,.0f} m, found {length:g} m")
        geometries = sorted(geometries, key=lambda each: number(each, "s"))
        starts = np.array([number(each, "s") for each in geometries])
        inner = [station for station in (*breaks, *starts) if 0.0 <= station < length]
        stations = np.unique(np.concatenate([np.arange(0.0, length, FINEST), inner, [length]]))
        stations = stations[np.append(True, np.diff(stations) > 1e-6)]
        piece = np.searchsorted(starts, stations, side="right") - 1
        points, headings = np.zeros((len(stations), 2)), np.zeros(len(stations))
        for row, geometry in enumerate(geometries):
            (here,) = np.nonzero(np.maximum(piece, 0) == row)
            if len(here):
                points[here], headings[here] = _sample(geometry, stations[here] - starts[row])
        return cls(stations, points, headings)

    def locate(self, station: float, aside: float) -> Float64:
        """Return the point (2,) [m] ``aside`` metres left of a station."""
        heading = float(np.interp(station, self.stations, np.unwrap(self.headings)))
        base = [np.interp(station, self.stations, column) for column in self.points.T]
        return np.array(base) + aside * np.array([-np.sin(heading), np.cos(heading)])


def _sample(geometry: Element, along: Float64) -> tuple[Float64, Float64]:
    """Points (n, 2) and headings (n,) of a geometry at distances (n,), sorted, from its start."""
    start = np.array([number(geometry, "x"), number(geometry, "y")])
    heading, length = number(geometry, "hdg"), max(number(geometry, "length"), 1e-9)
    if length > _LONGEST:
        raise ValueError(f"<geometry>, length: expected up to {_LONGEST:,.0f} m, found {length:g}")
    shape = next((each for each in geometry if each.tag in ("line", "arc", "spiral", "poly3", "paramPoly3")), None)
    if shape is None:
        raise ValueError("<geometry>: expected line, arc, spiral, poly3 or paramPoly3, found none")
    if shape.tag in ("line", "arc", "spiral"):
        first = number(shape, "curvStart" if shape.tag == "spiral" else "curvature", 0.0)
        rate = (number(shape, "curvEnd") - first) / length if shape.tag == "spiral" else 0.0
        before = np.append(0.0, along[:-1])
        nodes, weights = _GAUSS
        inner = before[:, None] + (along - before)[:, None] * nodes
        angles = heading + inner * (first + 0.5 * rate * inner)
        steps = (along - before)[:, None] * np.stack([np.cos(angles) @ weights, np.sin(angles) @ weights], axis=1)
        return start + np.cumsum(steps, axis=0), heading + along * (first + 0.5 * rate * along)
    is_cubic = shape.tag == "poly3"
    end = length if is_cubic or shape.get("pRange") == "arcLength" else 1.0
    suffixes = ("", "") if is_cubic else ("U", "V")
    u, v = (np.array([number(shape, f"{key}{suffix}", 0.0) for key in "abcd"]) for suffix in suffixes)
    if is_cubic:
        u = np.array([0.0, 1.0, 0.0, 0.0])
    parameter = np.linspace(0.0, end, int(length * _GRID) + 32)
    powers = parameter[:, None] ** np.arange(4)
    passed = np.append(0.0, np.cumsum(np.hypot(np.diff(powers @ u), np.diff(powers @ v))))
    if not is_cubic and passed[-1] > 0:
        passed *= length / passed[-1]
    at = np.interp(along, passed, parameter)
    powers, slopes = at[:, None] ** np.arange(4), at[:, None] ** np.arange(3) * np.arange(1, 4)
    turned = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    points = start + np.stack([powers @ u, powers @ v], axis=1) @ turned
    return points, heading + np.arctan2(slopes @ v[1:], slopes @ u[1:])
