"""Paths of straight pieces and circular arcs, for lanes, lines and edges of generated roads.

A path starts at a pose and consists of pieces of constant curvature, so headings are continuous, offsets to
the side are exact (an arc's offset is an arc), and samples are on the true curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function, kernel

PathPieces = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Pose:
    """A point x, y [m] and a heading [rad] in the map frame."""

    x: float
    y: float
    heading: float

    def moved(self, ahead: float, left: float, turn: float = 0.0) -> Pose:
        """Return the pose ``ahead`` and ``left`` of this one [m], rotated by ``turn`` [rad]."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return Pose(self.x + ahead * cos - left * sin, self.y + ahead * sin + left * cos, self.heading + turn)


@dataclass(frozen=True)
class RoadPath:
    """A start pose and pieces (length [m], curvature [1/m], positive to the left)."""

    start: Pose
    pieces: PathPieces

    @cached_property
    def length(self) -> float:
        """Arc length [m]."""
        total = 0.0
        for length, _ in self.pieces:  # not `sum`, which rounds otherwise from Python 3.12 on
            total += length
        return total

    @cached_property
    def end(self) -> Pose:
        """Pose at the end."""
        return self.pose_at(self.length)

    def pose_at(self, s: float) -> Pose:
        """Return the pose after ``s`` metres."""
        x, y, heading = self.start.x, self.start.y, self.start.heading
        for length, curvature in self.pieces:
            x, y, heading = _advance(x, y, heading, min(s, length), curvature)
            s -= min(s, length)
        return Pose(x, y, heading)

    @property
    def max_curvature(self) -> float:
        """Largest absolute curvature [1/m]."""
        return float(np.abs(np.array(self.pieces)[:, 1]).max())

    def offset(self, left: float) -> RoadPath:
        """Return the parallel path ``left`` metres to the left (negative: right)."""
        pieces: PathPieces = ()
        for length, curvature in self.pieces:
            stretch = 1.0 - curvature * left
            pieces += ((length * stretch, curvature / stretch),)
        return RoadPath(self.start.moved(0.0, left), pieces)

    def reversed(self) -> RoadPath:
        """Return the same curve in the opposite direction."""
        pieces: PathPieces = ()
        for length, curvature in self.pieces:
            pieces = ((length, -curvature), *pieces)
        return RoadPath(self.end.moved(0.0, 0.0, math.pi), pieces)

    def then(self, *pieces: tuple[float, float]) -> RoadPath:
        """Return this path, extended by pieces."""
        return RoadPath(self.start, self.pieces + pieces)

    def sample(self, spacing: float) -> tuple[Float64, Float64]:
        """Return points (n, 2) [m] and headings (n,) [rad], spaced equally by at most ``spacing``, ends included."""
        count = max(2, math.ceil(self.length / spacing - 1e-9) + 1)
        start = np.array([self.start.x, self.start.y, self.start.heading])
        samples = np.empty((count, 3))
        _trace(start, np.array(self.pieces, dtype=np.float64), self.length / (count - 1), samples)
        return samples[:, :2], samples[:, 2]


def bend(turn: float, radius: float) -> tuple[float, float]:
    """Return the piece that turns by ``turn`` [rad] (positive to the left) on a circle of ``radius`` [m]."""
    return radius * abs(turn), math.copysign(1.0 / radius, turn)


def shift(ahead: float, left: float) -> PathPieces:
    """Return two opposite arcs that shift a path ``left`` metres over ``ahead`` metres and keep its heading."""
    turn = 2.0 * math.atan2(abs(left), ahead)
    radius = ahead / (2.0 * math.sin(turn))
    first = bend(math.copysign(turn, left), radius)
    return first, (first[0], -first[1])


def connect(start: Pose, end: Pose, lead: float) -> RoadPath:
    """Connect two poses by a straight, an arc and a straight; the straights are at least ``lead`` long.

    The poses' lines must meet ahead of ``start`` and behind ``end``, or both be the same line.
    """
    dx, dy = end.x - start.x, end.y - start.y
    turn = math.remainder(end.heading - start.heading, 2.0 * math.pi)
    if abs(turn) < 1e-9:
        return RoadPath(start, ((math.hypot(dx, dy), 0.0),))
    sin = math.sin(turn)
    before = (dx * math.sin(end.heading) - dy * math.cos(end.heading)) / sin
    after = (dy * math.cos(start.heading) - dx * math.sin(start.heading)) / sin
    tangent = min(before, after) - lead
    arc = bend(turn, tangent / math.tan(abs(turn) / 2.0))
    pieces = ((before - tangent, 0.0), arc, (after - tangent, 0.0))
    return RoadPath(start, tuple(piece for piece in pieces if piece[0] > 1e-9))


def turn_around(start: Pose, end: Pose, lead: float, radius: float) -> RoadPath:
    """Connect two poses beside each other, of opposite headings, by a straight and a half-turn to the left.

    Where they are less than two radii apart, the path swings out to the right before the turn, and back after it: to
    the side, arcs of ``radius`` over an angle a make 2 r cos(a) - 2 r (1 - cos(a)). The radius is ``radius`` or more.
    """
    apart = (end.y - start.y) * math.cos(start.heading) - (end.x - start.x) * math.sin(start.heading)
    radius = max(radius, apart / 2.0)
    swing = math.acos(min(1.0, (apart / radius + 2.0) / 4.0))
    out = bend(-swing, radius)
    pieces = ((lead, 0.0), out, bend(math.pi + 2.0 * swing, radius), out, (lead, 0.0))
    return RoadPath(start, tuple(piece for piece in pieces if piece[0] > 1e-9))


def _advance(x: float, y: float, heading: float, length: float, curvature: float) -> tuple[float, float, float]:
    """Pose after ``length`` on a circle, or straight on."""
    turn = curvature * length
    half = 0.5 * turn
    chord = length if abs(half) < 1e-9 else length * math.sin(half) / half
    return x + chord * math.cos(heading + half), y + chord * math.sin(heading + half), heading + turn


_advance_compiled = device_function(_advance)


@kernel
def _trace(start: Float64, pieces: Float64, step: float, samples: Float64) -> None:
    """Write x, y, heading every ``step`` metres along ``pieces`` (k, 2) to ``samples`` (n, 3)."""
    x, y, heading = start[0], start[1], start[2]
    piece, done = 0, 0.0
    for row in range(len(samples)):
        ahead = row * step - done
        while piece < len(pieces) - 1 and ahead > pieces[piece, 0]:
            x, y, heading = _advance_compiled(x, y, heading, pieces[piece, 0], pieces[piece, 1])
            done += pieces[piece, 0]
            ahead = row * step - done
            piece += 1
        pose = _advance_compiled(x, y, heading, ahead, pieces[piece, 1])
        samples[row, 0], samples[row, 1], samples[row, 2] = pose
