"""Formats of pictures: NV12, and noise of the sensor."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, UInt8
from scenarionet_data.errors import BadParameter


def to_nv12(rgb: UInt8) -> UInt8:
    """Convert pictures (..., H, W, 3) to NV12 (..., 3 H / 2, W): luma, then U and V in turn at half the resolution.

    BT.601, limited range.

    Raises:
        BadParameter: Height or width is odd.
    """
    height, width = rgb.shape[-3:-1]
    if height % 2 or width % 2:
        raise BadParameter(f"NV12 needs an even height and width, found {height} x {width}")
    color: Float32 = rgb.astype(np.float32)
    out: UInt8 = np.empty((*rgb.shape[:-3], height * 3 // 2, width), np.uint8)
    luma = color @ np.array([65.481, 128.553, 24.966], np.float32) / 255 + 16
    out[..., :height, :] = np.rint(luma)
    halves = color.reshape(*rgb.shape[:-3], height // 2, 2, width // 2, 2, 3).mean(axis=(-4, -2))
    chroma = halves @ np.array([[-37.797, 112.0], [-74.203, -93.786], [112.0, -18.214]], np.float32) / 255 + 128
    out[..., height:, :] = np.rint(chroma).reshape(*rgb.shape[:-3], height // 2, width)
    return out


def add_pixel_noise(rgb: UInt8, spread: float, rng: np.random.Generator) -> None:
    """Add Gaussian noise of a standard deviation [levels] to pictures in place."""
    noisy = rgb + spread * rng.standard_normal(rgb.shape, np.float32)
    np.clip(np.rint(noisy, out=noisy), 0, 255, out=noisy)
    rgb[...] = noisy
