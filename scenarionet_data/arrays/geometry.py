"""Plane geometry on arrays: angles, path lengths, rotations, boxes, velocities."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64


def wrap_angle(angle: npt.ArrayLike) -> Array:
    """Angle in [-pi, pi), in the input's own precision (float64 for integers).

    The upper bound is open in that precision too: float32 pi becomes -pi. NaN and infinite angles give NaN.

    Example:
        >>> float(wrap_angle(np.pi)) == -np.pi
        True
    """
    array = np.asarray(angle)
    if array.dtype.kind != "f":
        array = array.astype(np.float64)
    pi = array.dtype.type(np.pi)
    if ((array >= -pi) & (array < pi)).all():
        return array
    with np.errstate(invalid="ignore"):  # infinite angles
        wrapped = array - 2 * pi * np.floor((array + pi) / (2 * pi))
    wrapped = np.where((array >= -pi) & (array < pi), array, wrapped)
    return np.where((wrapped < -pi) | (wrapped >= pi), -pi, wrapped).astype(array.dtype)


def path_length(points: Array) -> float:
    """Length of a path in the plane [m]; points (n, 2 or more)."""
    return float(np.hypot(*np.diff(points[:, :2].astype(np.float64), axis=0).T).sum())


def yaw_from_quaternion(qw: Float64, qx: Float64, qy: Float64, qz: Float64) -> Float64:
    """Heading [rad] of unit quaternions, counter-clockwise from +x, in [-pi, pi]."""
    return np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))


def rotate(points: Array, angle: npt.ArrayLike) -> Float64:
    """Points (..., 2) rotated counter-clockwise by ``angle`` (...) [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = points[..., 0], points[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def box_corners(center: Array, heading: Array, length: Array, width: Array) -> Float64:
    """Corners (..., 4, 2) of boxes, counter-clockwise from the front left; center (..., 2), the rest (...)."""
    signs = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
    local = signs * np.stack([length, width], axis=-1)[..., None, :]
    corners: Float64 = rotate(local, np.asarray(heading)[..., None]) + np.asarray(center)[..., None, :2]
    return corners


def median_sizes(size: Array, valid: Bool) -> Float32:
    """(N, k) float32 medians of sizes (N, T, k) over the valid steps (N, T); 0 for objects that are never valid.

    The median is robust against sensor noise.
    """
    first = size[np.arange(len(size)), valid.argmax(axis=1)]
    first[~valid.any(axis=1)] = 0.0
    if ((size == first[:, None]).all(axis=2) | ~valid).all():
        return np.asarray(first, np.float32)
    ordered = np.sort(np.where(valid[..., None], size, np.inf), axis=1)
    count = valid.sum(axis=1)
    middle = np.stack([(count - 1) // 2, count // 2], axis=1).clip(0)
    sizes = np.take_along_axis(ordered, middle[..., None], axis=1).mean(axis=1)
    sizes[count == 0] = 0.0
    medians: Float32 = sizes.astype(np.float32)
    return medians


def estimate_velocity(position: Array, valid: Bool, timestamps: Array) -> Float64:
    """Estimate velocity from positions by central differences over valid neighbours, for sources without velocity.

    One-sided at both ends of a run of valid timesteps; 0 for a state without a valid neighbour.

    Args:
        position: (N, T, 2 or more) [m]; x and y are used.
        valid: (N, T).
        timestamps: (T,) [s], strictly increasing.

    Returns:
        (N, T, 2) [m/s], 0 where not valid.
    """
    both = valid[:, 1:] & valid[:, :-1]
    here = np.broadcast_to(np.arange(len(timestamps)), valid.shape)
    before, after = here.copy(), here.copy()
    before[:, 1:] -= both
    after[:, :-1] += both
    time = np.asarray(timestamps, dtype=np.float64)
    span = (time[after] - time[before])[..., None]
    xy = np.where(valid[..., None], position[..., :2], 0.0)
    step = np.take_along_axis(xy, after[..., None], axis=1) - np.take_along_axis(xy, before[..., None], axis=1)
    velocity: Float64 = np.divide(step, span, out=np.zeros_like(step), where=span > 0)
    return velocity
