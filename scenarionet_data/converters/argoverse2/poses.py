"""Rotations and poses of Argoverse 2 sensor logs: unit quaternions w, x, y, z and the interpolated ego pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.converters.argoverse2.table import numbers, read_feather
from scenarionet_data.errors import CorruptSource

QUATERNION = ("qw", "qx", "qy", "qz")
TRANSLATION = ("tx_m", "ty_m", "tz_m")


@dataclass(frozen=True, eq=False)
class Poses:
    """The ego frame in the city frame at S times.

    Attributes:
        turn: (S, 4) unit quaternions.
        shift: (S, 3) [m].
        num_interpolated: Number of times without a recorded pose.
    """

    turn: Float64
    shift: Float64
    num_interpolated: int

    def to_city(self, points: Float64, at: Int64) -> Float64:
        """Transform points (R, 3) from the ego frame to the city frame with poses ``at`` (R,)."""
        return rotated(self.turn[at], points) + self.shift[at]


def read_poses(path: Path, times: Int64) -> Poses:
    """Return the poses at ``times`` (S,) [ns]: recorded ones, or interpolated between the adjacent two.

    Raises:
        CorruptSource: The file is missing or damaged, or does not cover a time.
    """
    rows = read_feather(path, ("timestamp_ns", *QUATERNION, *TRANSLATION))
    recorded, first = np.unique(numbers(rows, path, "timestamp_ns"), return_index=True)
    if not len(recorded) or times[0] < recorded[0] or times[-1] > recorded[-1]:
        raise CorruptSource(f"{path}: expected poses around every annotated sweep; download the log again")
    turn, shift = quaternions(rows, path)[first], numbers(rows, path, *TRANSLATION)[first]
    after = np.searchsorted(recorded, times)
    is_exact = recorded[after] == times
    before = np.where(is_exact, after, after - 1)
    span = np.where(is_exact, 1, recorded[after] - recorded[before])
    share = ((times - recorded[before]) / span)[:, None]
    # A quaternion and its negative are the same rotation: interpolate the nearer one. Poses are 6 ms apart, so that
    # normalised linear interpolation equals slerp.
    sign = np.where((turn[before] * turn[after]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    blended = (1 - share) * turn[before] + share * sign * turn[after]
    blended /= np.linalg.norm(blended, axis=1, keepdims=True)
    return Poses(blended, (1 - share) * shift[before] + share * shift[after], int((~is_exact).sum()))


def quaternions(rows: Any, path: Path) -> Float64:
    """Read quaternions (R, 4) of a table, normalised.

    Raises:
        CorruptSource: One is far from unit length.
    """
    columns = numbers(rows, path, *QUATERNION)
    norm = np.linalg.norm(columns, axis=1, keepdims=True)
    if (np.abs(norm - 1.0) > 1e-2).any():
        raise CorruptSource(f"{path}: columns qw, qx, qy, qz: expected quaternions of length 1; download it again")
    unit: Float64 = columns / norm
    return unit


def rotated(turn: Float64, vectors: Float64) -> Float64:
    """Rotate vectors (R, 3) by unit quaternions (R, 4): v + 2 w (u x v) + 2 u x (u x v)."""
    w, u = turn[:, :1], turn[:, 1:]
    twice = 2.0 * np.cross(u, vectors)
    turned: Float64 = vectors + w * twice + np.cross(u, twice)
    return turned


def forward(turn: Float64) -> Float64:
    """(R, 3) direction of +x after each rotation."""
    return rotated(turn, np.broadcast_to([1.0, 0.0, 0.0], (len(turn), 3)))


def heading(direction: Float64) -> Float64:
    """(R,) [rad] of directions (R, 3) in the plane."""
    angle: Float64 = np.arctan2(direction[:, 1], direction[:, 0])
    return angle
