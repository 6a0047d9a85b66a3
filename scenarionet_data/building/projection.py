"""UTM: from degrees to metres, without a library of geodesy."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

_FLATTENING = 1.0 / 298.257223563
_N = _FLATTENING / (2.0 - _FLATTENING)
_RADIUS = 6378137.0 / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_ALPHA = (
    _N / 2.0 - 2.0 * _N**2 / 3.0 + 5.0 * _N**3 / 16.0,
    13.0 * _N**2 / 48.0 - 3.0 * _N**3 / 5.0,
    61.0 * _N**3 / 240.0,
)
"""Krueger's series of WGS 84 to the third order of its flattening: exact to 0.1 mm within a zone."""


def utm_zone(longitude: float) -> int:
    """Number of the zone, 1 to 60, of a longitude [degrees]."""
    return int((longitude + 180.0) // 6.0) % 60 + 1


def to_utm(latitude: Float64, longitude: Float64, zone: int) -> Float64:
    """Easting and northing (n, 2) [m] of WGS 84 coordinates (n,) [degrees]; negative south of the equator."""
    phi, away = np.radians(latitude), np.radians(longitude - (6.0 * zone - 183.0))
    eccentricity = 2.0 * np.sqrt(_N) / (1.0 + _N)
    sine = np.sin(phi)
    t = np.sinh(np.arctanh(sine) - eccentricity * np.arctanh(eccentricity * sine))
    # The series in complex numbers: the sine of a complex angle holds both of its real products.
    angle = np.arctan2(t, np.cos(away)) + 1j * np.arctanh(np.sin(away) / np.hypot(1.0, t))
    angle = angle + sum(alpha * np.sin(2.0 * order * angle) for order, alpha in enumerate(_ALPHA, 1))
    return np.stack([500_000.0 + 0.9996 * _RADIUS * angle.imag, 0.9996 * _RADIUS * angle.real], axis=-1)
