"""The frame in which a planner sees the world and answers: the scenario's, or that of its vehicle."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Complex128, Float64

_TURN = 2.0 * math.pi


class ViewFrame:
    """A pose in the scenario's frame: the origin of another frame, x forward and y to the left.

    Args:
        x, y: [m].
        heading: [rad].
        is_scenario: The scenario's own frame, in which arrays stay views.
    """

    __slots__ = ("_back", "_origin", "_turn", "heading", "is_scenario")

    def __init__(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0, *, is_scenario: bool = True) -> None:
        self.heading, self.is_scenario = heading, is_scenario
        # Points as complex numbers are turned by one product, without the threads of a product of matrices.
        self._origin, self._turn = complex(x, y), complex(math.cos(heading), math.sin(heading))
        self._back = self._turn.conjugate()

    def points(self, points: Array) -> Array:
        """Return points (..., 2) of the scenario in this frame [m]."""
        return points if self.is_scenario else _from_complex((_to_complex(points) - self._origin) * self._back)

    def vectors(self, vectors: Array) -> Array:
        """Return vectors (..., 2) of the scenario in this frame."""
        return vectors if self.is_scenario else _from_complex(_to_complex(vectors) * self._back)

    def angles(self, angles: Array) -> Array:
        """Return directions of the scenario in this frame [rad], in [-pi, pi)."""
        if self.is_scenario:
            return angles
        turned = angles - self.heading
        turned -= _TURN * np.floor(turned * (1.0 / _TURN) + 0.5)  # in a third of the time of %
        return turned

    def points_to_scenario(self, points: Array) -> Array:
        """Return points (..., 2) of this frame in the scenario's [m]."""
        return points if self.is_scenario else _from_complex(_to_complex(points) * self._turn + self._origin)

    def poses_to_scenario(self, poses: Float64) -> Float64:
        """Return poses (K, 3) of this frame, x, y [m] and heading [rad], in the scenario's."""
        if self.is_scenario:
            return poses
        angles = (poses[:, 2] + (self.heading + math.pi)) % _TURN - math.pi
        return np.column_stack([self.points_to_scenario(poses[:, :2]), angles])


def _to_complex(points: Array) -> Complex128:
    """View points (..., 2) as complex numbers (...)."""
    found: Complex128 = np.ascontiguousarray(points, np.float64).view(np.complex128)[..., 0]
    return found


def _from_complex(numbers: Complex128) -> Float64:
    """View complex numbers (...) as points (..., 2)."""
    return numbers[..., None].view(np.float64)
