"""The frame in which a planner sees the world and answers: the scenario's, or that of its vehicle."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64
from scenarionet_sim.arrays.log import HEADING, VX, VY

_TURN = 2.0 * math.pi


class ViewFrame:
    """A pose in the scenario's frame: the origin of another frame, x forward and y to the left.

    Args:
        x, y: [m].
        heading: [rad].
        is_scenario: The scenario's own frame, in which arrays stay views.
    """

    __slots__ = ("_back", "heading", "is_scenario", "origin")

    def __init__(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0, *, is_scenario: bool = True) -> None:
        self.origin, self.heading, self.is_scenario = np.array([x, y]), heading, is_scenario
        cos, sin = math.cos(heading), math.sin(heading)
        self._back = np.array([[cos, -sin], [sin, cos]])

    def motion(self, motion: Float64) -> tuple[Float64, Float64, Float64]:
        """Return position (N, 2) [m], heading (N,) [rad] and velocity (N, 2) [m/s] of motion (N, 7) in this frame."""
        if self.is_scenario:
            return motion[:, :2], motion[:, HEADING], motion[:, VX : VY + 1]
        return *self._poses(motion), self._turned(motion[:, VX : VY + 1])

    def path(self, path: Float32, first: int, end: int) -> tuple[Array, Array]:
        """Return the rows ``first`` to ``end`` of ``Paths.path`` in this frame: (P, 2) [m], headings (P,) [rad]."""
        if self.is_scenario:
            return path[first:end, :2], path[first:end, HEADING]
        return self._poses(path[first:end].astype(np.float64))

    def points(self, points: Array) -> Array:
        """Return points (..., 2) of the scenario in this frame [m]."""
        return points if self.is_scenario else (points - self.origin) @ self._back

    def angles(self, angles: Array) -> Array:
        """Return directions of the scenario in this frame [rad], in [-pi, pi)."""
        return angles if self.is_scenario else (angles - (self.heading - math.pi)) % _TURN - math.pi

    def points_to_scenario(self, points: Array) -> Array:
        """Return points (..., 2) of this frame in the scenario's [m]."""
        return points if self.is_scenario else points @ self._back.T + self.origin

    def poses_to_scenario(self, poses: Float64) -> Float64:
        """Return poses (K, 3) of this frame, x, y [m] and heading [rad], in the scenario's."""
        if self.is_scenario:
            return poses
        angles = (poses[:, 2] + (self.heading + math.pi)) % _TURN - math.pi
        return np.column_stack([self.points_to_scenario(poses[:, :2]), angles])

    def _poses(self, rows: Float64) -> tuple[Float64, Float64]:
        """Return places (N, 2) [m] and headings (N,) [rad] in [-pi, pi) of rows that begin with those of a log."""
        angles = rows[:, HEADING] - self.heading
        return self._turned(rows[:, :2] - self.origin), angles - _TURN * np.floor((angles + math.pi) / _TURN)

    def _turned(self, vectors: Float64) -> Float64:
        """Return vectors (N, 2) of the scenario in this frame."""
        x, y, (cos, sin) = vectors[:, 0], vectors[:, 1], self._back[:, 0]
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=1)
