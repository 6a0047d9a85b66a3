"""Lenses: intrinsics of a camera, and the ray of every pixel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at

Intrinsics = tuple[float, float, float, float]
"""Focal lengths fx, fy and principal point cx, cy [pixels]; the centre of the first pixel is at (0.5, 0.5)."""


def lens_of(kind: str, intrinsics: Intrinsics, distortion: tuple[float, ...]) -> Float64:
    """Return a lens (NUM_LENS,) as kernels take it.

    Args:
        kind: ``pinhole`` or ``fisheye``.
        intrinsics: See above.
        distortion: Of a pinhole k1, k2, p1, p2, k3 (Brown, Conrady); of a fisheye k1, k2, k3, k4 (Kannala, Brandt);
            missing ones are 0.
    """
    lens = np.zeros(at.NUM_LENS)
    lens[[at.FX, at.FY, at.CX, at.CY]] = intrinsics
    lens[[at.K1, at.K2, at.P1, at.P2, at.K3][: len(distortion)]] = distortion
    lens[at.KIND] = codes.FISHEYE if kind == "fisheye" else (codes.DISTORTED if any(distortion) else codes.PINHOLE)
    return lens


_NO_RAYS: Float64 = np.zeros((0, 0, 3))
_NO_RAYS.flags.writeable = False  # as all rays: one type of arrays, for which kernels are compiled once


@lru_cache(maxsize=16)
def rays_of(lens: tuple[float, ...], width: int, height: int) -> Float64:
    """Return the directions (H, W, 3) right, down, ahead of the pixels' centres.

    The third component is 1 with a pinhole, distorted or not; a fisheye's directions are unit vectors. An undistorted
    pinhole needs none: its array is empty.
    """
    kind = int(lens[at.KIND])
    if kind == codes.PINHOLE:
        return _NO_RAYS
    u = (np.arange(width) + 0.5 - lens[at.CX]) / lens[at.FX]
    v = (np.arange(height) + 0.5 - lens[at.CY]) / lens[at.FY]
    bent = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)
    rays = np.empty((height, width, 3))
    if kind == codes.FISHEYE:
        radius = np.hypot(bent[..., 0], bent[..., 1])
        angle = _unbend(radius, (lens[at.K1], lens[at.K2], lens[at.P1], lens[at.P2]))
        scale = np.divide(np.sin(angle), radius, out=np.ones_like(radius), where=radius > 1e-12)
        rays[..., :2], rays[..., 2] = bent * scale[..., None], np.cos(angle)
    else:
        rays[..., :2], rays[..., 2] = _undistort(bent, lens), 1.0
    rays.flags.writeable = False
    return rays


def _unbend(radius: Float64, k: tuple[float, float, float, float]) -> Float64:
    """Return the angle from the axis whose bent angle is ``radius``, by Newton's method, at most pi."""
    angle = radius.copy()
    for _ in range(20):
        square = angle * angle
        value = angle * (1 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))))
        slope = 1 + square * (3 * k[0] + square * (5 * k[1] + square * (7 * k[2] + square * 9 * k[3])))
        angle = np.clip(angle - (value - radius) / np.where(np.abs(slope) < 1e-6, 1e-6, slope), 0.0, np.pi)
    return angle


def _undistort(bent: Float64, lens: tuple[float, ...]) -> Float64:
    """Return the undistorted places (..., 2) of distorted ones, by Newton's method."""
    place = bent.copy()
    k1, k2, p1, p2, k3 = (lens[column] for column in (at.K1, at.K2, at.P1, at.P2, at.K3))
    for _ in range(20):
        u, v = place[..., 0], place[..., 1]
        square = u * u + v * v
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        slope = 2 * (k1 + square * (2 * k2 + square * 3 * k3))
        found_u = u * radial + 2 * p1 * u * v + p2 * (square + 2 * u * u) - bent[..., 0]
        found_v = v * radial + p1 * (square + 2 * v * v) + 2 * p2 * u * v - bent[..., 1]
        uu = radial + u * u * slope + 2 * p1 * v + 6 * p2 * u
        uv = u * v * slope + 2 * p1 * u + 2 * p2 * v
        vv = radial + v * v * slope + 6 * p1 * v + 2 * p2 * u
        volume = uu * vv - uv * uv
        volume = np.where(np.abs(volume) < 1e-9, 1e-9, volume)
        place[..., 0] -= (vv * found_u - uv * found_v) / volume
        place[..., 1] -= (uu * found_v - uv * found_u) / volume
    return np.clip(place, -20.0, 20.0)
