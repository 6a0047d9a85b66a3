"""Rotations and poses of Argoverse 2 sensor logs: unit quaternions w, x, y, z and the interpolated ego pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.building import EGO_GAP
from scenarionet_data.building.plausible import MAX_DISTANCE
from scenarionet_data.converters.argoverse2.table import integers, numbers, read_feather
from scenarionet_data.errors import CorruptSource

QUATERNION = ("qw", "qx", "qy", "qz")
TRANSLATION = ("tx_m", "ty_m", "tz_m")
_MARGIN = 100_000_000
"""Time [ns] by which sweeps may precede the first pose or follow the last."""
_LONGEST = 3_600_000_000_000
"""Time [ns] from the middle of a log beyond which a pose is not part of it; logs last about 16 s."""


@dataclass(frozen=True, eq=False)
class Poses:
    """The ego frame in the city frame at S times.

    Attributes:
        turn: (S, 4) unit quaternions.
        shift: (S, 3) [m].
        is_interpolated: (S,) whether there is no recorded pose at this time.
    """

    turn: Float64
    shift: Float64
    is_interpolated: Bool

    def to_city(self, points: Float64, at: Int64) -> Float64:
        """Transform points (R, 3) from the ego frame to the city frame with poses ``at`` (R,)."""
        return rotated(self.turn[at], points) + self.shift[at]


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """The recorded poses of a log, without those that cannot be used.

    Attributes:
        times: (P,) int64 [ns], strictly increasing; at least one.
        turn: (P, 4) unit quaternions.
        shift: (P, 3) [m].
        bad_rows: Rows of the file that cannot be used.
    """

    times: Int64
    turn: Float64
    shift: Float64
    bad_rows: Int64

    def covers(self, times: Int64) -> Bool:
        """Whether each of some times (R,) [ns] has a pose, is in a short gap, or at most 0.1 s before or after all."""
        inside = (times >= self.times[0] - _MARGIN) & (times <= self.times[-1] + _MARGIN)
        after = np.searchsorted(self.times, times).clip(0, len(self.times) - 1)
        gap = self.times[after] - self.times[np.maximum(after - 1, 0)]
        covered: Bool = inside & ((gap <= EGO_GAP * 1e9) | (self.times[after] <= times))
        return covered

    def at(self, times: Int64) -> Poses:
        """Return the poses at ``times`` (S,) [ns]: recorded, interpolated between the adjacent two, or the nearest."""
        near = np.clip(times, self.times[0], self.times[-1])
        after = np.searchsorted(self.times, near)
        is_exact = self.times[after] == near
        before = np.where(is_exact, after, after - 1)
        span = np.where(is_exact, 1, self.times[after] - self.times[before])
        share = ((near - self.times[before]) / span)[:, None]
        # A quaternion and its negative are the same rotation: interpolate the nearer one. Poses are 6 ms apart, so that
        # normalised linear interpolation equals slerp.
        turn, shift = self.turn, self.shift
        sign = np.where((turn[before] * turn[after]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        blended = (1 - share) * turn[before] + share * sign * turn[after]
        blended /= np.linalg.norm(blended, axis=1, keepdims=True)
        return Poses(blended, (1 - share) * shift[before] + share * shift[after], self.times[after] != times)


def read_poses(path: Path) -> RecordedPoses:
    """Read the poses of a log.

    Raises:
        CorruptSource: The file is missing or damaged, or has no pose that can be used.
    """
    rows = read_feather(path, ("timestamp_ns", *QUATERNION, *TRANSLATION))
    times, known = integers(rows, path, "timestamp_ns")
    turn, is_turn = quaternions(rows, path)
    shift = numbers(rows, path, *TRANSLATION)
    known &= is_turn & np.isfinite(shift).all(axis=1)
    for values, furthest in ((shift, MAX_DISTANCE), (times[:, None], _LONGEST)):
        if known.any():
            middle = np.median(values[known], axis=0)
            known &= (np.abs(np.where(known[:, None], values - middle, 0.0)) <= furthest).all(axis=1)
    (kept,) = np.nonzero(known)
    recorded, first = np.unique(times[kept], return_index=True)
    if not len(recorded):
        raise CorruptSource(f"{path}: expected poses of the ego, found none; download the log again")
    return RecordedPoses(recorded, turn[kept[first]], shift[kept[first]], np.flatnonzero(~known))


def quaternions(rows: Any, path: Path) -> tuple[Float64, Bool]:
    """Read quaternions (R, 4) of a table, normalised, and whether each is one: known, and of length 1 within 1 %.

    Raises:
        CorruptSource: A column is missing or does not contain numbers.
    """
    columns = numbers(rows, path, *QUATERNION)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        norm = np.linalg.norm(columns, axis=1, keepdims=True)
        is_turn: Bool = np.abs(norm[:, 0] - 1.0) <= 1e-2
        unit: Float64 = columns / norm
    return unit, is_turn


def rotated(turn: Float64, vectors: Float64) -> Float64:
    """Rotate vectors (R, 3) by unit quaternions (R, 4): v + 2 w (u x v) + 2 u x (u x v)."""
    w, u = turn[:, :1], turn[:, 1:]
    twice = 2.0 * np.cross(u, vectors)
    return vectors + w * twice + np.cross(u, twice)


def forward(turn: Float64) -> Float64:
    """(R, 3) direction of +x after each rotation."""
    return rotated(turn, np.broadcast_to([1.0, 0.0, 0.0], (len(turn), 3)))


def heading(direction: Float64) -> Float64:
    """(R,) [rad] of directions (R, 3) in the plane."""
    return np.arctan2(direction[:, 1], direction[:, 0])
