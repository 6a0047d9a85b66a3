"""Smooth curves through the points of a polyline, as cubic pieces with continuous direction.

A piece is a cubic Hermite spline over a parameter from 0 to 1. Points that the curve does not need to stay within a
tolerance of the polyline are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_SHORTEST = 1e-3  # [m] closer points are one


@dataclass(frozen=True)
class Curve:
    """A curve of P pieces.

    Attributes:
        points: (P + 1, 3) its knots [m].
        tangent: (P + 1, 2) unit vectors in the plane.
        stations: (P + 1,) arc length in the plane at the knots [m].
        coefficients: (P, 4, 2) of 1, t, t², t³ for x and y.
    """

    points: Float64
    tangent: Float64
    stations: Float64
    coefficients: Float64
    _samples: dict[float, tuple[Float64, Float64, Float64]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def length(self) -> float:
        """Arc length in the plane [m]."""
        return float(self.stations[-1])

    def sample(self, step: float) -> tuple[Float64, Float64, Float64]:
        """Return points of the curve at most ``step`` metres apart.

        Returns:
            (S, 2) points [m], (S,) stations [m] and (S, 2) tangents, at the knots and between them.
        """
        if step in self._samples:
            return self._samples[step]
        counts = np.maximum(np.ceil(np.diff(self.stations) / step).astype(int), 1)
        piece = np.repeat(np.arange(len(counts)), counts)
        t = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[piece]
        piece, t = np.append(piece, len(counts) - 1), np.append(t, 1.0)
        c = self.coefficients[piece]
        points = ((c[:, 3] * t[:, None] + c[:, 2]) * t[:, None] + c[:, 1]) * t[:, None] + c[:, 0]
        slope = (3.0 * c[:, 3] * t[:, None] + 2.0 * c[:, 2]) * t[:, None] + c[:, 1]
        chord = np.hypot(*np.diff(points, axis=0).T)
        part = np.concatenate([[0.0], np.cumsum(chord)])
        known = np.append(np.cumsum(counts) - counts, counts.sum())
        stations = np.interp(part, part[known], self.stations)  # chords, stretched to the arc length of each piece
        tangents = slope / np.maximum(np.hypot(*slope.T), 1e-12)[:, None]
        return self._samples.setdefault(step, (points, stations, tangents))


def distinct(points: Float64) -> Float64:
    """Return a polyline without points less than a millimetre behind the one before (in the plane).

    Args:
        points: (P, 3) [m].
    """
    if len(points) > 1 and np.hypot(*np.diff(points[:, :2], axis=0).T).min() > _SHORTEST:
        return points
    kept = list(range(min(len(points), 1)))
    for row in range(1, len(points)):
        if np.hypot(*(points[row, :2] - points[kept[-1], :2])) > _SHORTEST:
            kept.append(row)
    return points[kept]


def fit(points: Float64, tolerance: float = 0.02) -> Curve:
    """Fit a curve to a polyline, which it passes at its ends.

    Args:
        points: (P, 3) [m], at least two distinct points.
        tolerance: Distance between both [m] that is kept to where the line has no kinks.
    """
    line = shapely.LineString(points)
    for knots in (
        *(
            np.asarray(shapely.simplify(line, share * tolerance, preserve_topology=False).coords)
            for share in (1.0, 0.25)
        ),
        points,
        *(np.asarray(shapely.segmentize(line, longest).coords) for longest in (4.0, 1.0)),
    ):
        curve = through(distinct(knots))
        drawn = curve.sample(0.5)[0]
        if _farthest(points[:, :2], drawn) <= tolerance and _farthest(drawn, points[:, :2]) <= tolerance:
            break
    return curve


def _farthest(points: Float64, line: Float64) -> float:
    """The largest distance of points from a line [m]."""
    return float(shapely.distance(shapely.points(points), shapely.LineString(line)).max())


def through(points: Float64) -> Curve:
    """Return the curve with these knots.

    Its direction at a knot is that of the circle through the knot and its neighbours, and at the ends that of the
    circle through the first or last three.

    Args:
        points: (P, 3) [m], distinct in the plane.
    """
    plane = points[:, :2]
    chord = np.diff(plane, axis=0)
    length = np.hypot(*chord.T)
    unit = chord / length[:, None]
    if len(plane) == 2:
        tangent = np.repeat(unit, 2, axis=0)
    else:
        before, after = length[:-1, None], length[1:, None]
        inner = _normalised(unit[:-1] * after + unit[1:] * before)
        first = _normalised(2.0 * (inner[0] @ unit[0]) * unit[0] - inner[0])  # mirrored at the chord
        last = _normalised(2.0 * (inner[-1] @ unit[-1]) * unit[-1] - inner[-1])
        tangent = np.vstack([first, inner, last])
    return _pieces(points, tangent, length)


def joining(begin: Float64, begin_along: Float64, end: Float64, end_along: Float64) -> Curve:
    """Return the curve of one piece between two points with given directions.

    Args:
        begin, end: (3,) [m].
        begin_along, end_along: (2,) unit vectors.
    """
    length = np.hypot(*(end - begin)[:2])
    return _pieces(np.stack([begin, end]), np.stack([begin_along, end_along]), np.array([length]))


def _pieces(points: Float64, tangent: Float64, length: Float64) -> Curve:
    """The curve through knots with given directions, whose speed along each piece is its chord's length."""
    chord = np.diff(points[:, :2], axis=0)
    start, end = tangent[:-1] * length[:, None], tangent[1:] * length[:, None]
    plane = points[:-1, :2]
    coefficients = np.stack([plane, start, 3.0 * chord - 2.0 * start - end, start + end - 2.0 * chord], axis=1)
    t = 0.5 * (_NODES + 1.0)
    c = coefficients[:, :, None]
    slope = c[:, 1] + 2.0 * t[:, None] * c[:, 2] + 3.0 * t[:, None] ** 2 * c[:, 3]
    arc = 0.5 * (np.hypot(slope[..., 0], slope[..., 1]) * _WEIGHTS).sum(axis=1)
    return Curve(points, tangent, np.concatenate([[0.0], np.cumsum(arc)]), coefficients)


def _normalised(vectors: Float64) -> Float64:
    length: Float64 = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, 1e-12)


def trimmed(points: Float64, at_start: float, at_end: float) -> Float64:
    """Return a polyline that is shorter at its ends, by at most a tenth of its length each.

    Args:
        points: (P, 3) [m].
        at_start, at_end: Lengths in the plane [m].
    """
    part = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    first, last = min(at_start, 0.1 * part[-1]), part[-1] - min(at_end, 0.1 * part[-1])
    inside = (part > first) & (part < last)
    ends = np.stack([[np.interp(place, part, points[:, axis]) for axis in range(3)] for place in (first, last)])
    return np.vstack([ends[:1], points[inside], ends[1:]])
