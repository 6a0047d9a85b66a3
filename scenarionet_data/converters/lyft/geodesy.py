"""Transform local frames on the WGS 84 ellipsoid to earth-centred coordinates, as used by Lyft's map."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

SEMI_MAJOR_AXIS = 6_378_137.0
"""Semi-axes of the WGS 84 ellipsoid [m]."""
FLATTENING = 1.0 / 298.257223563
_SQUARED_ECCENTRICITY = FLATTENING * (2.0 - FLATTENING)


def on_ellipsoid(latitude: Float64, longitude: Float64) -> Float64:
    """Return the earth-centred, earth-fixed coordinates of points of height 0 (EPSG 9602).

    Args:
        latitude, longitude: (K,) geodetic [rad].

    Returns:
        (K, 3) [m].

    Example:
        >>> on_ellipsoid(np.zeros(1), np.zeros(1)).tolist()
        [[6378137.0, 0.0, 0.0]]
    """
    normal = SEMI_MAJOR_AXIS / np.sqrt(1.0 - _SQUARED_ECCENTRICITY * np.sin(latitude) ** 2)
    scale = np.stack([normal, normal, normal * (1.0 - _SQUARED_ECCENTRICITY)], axis=-1)
    point: Float64 = scale * _axes(latitude, longitude)[:, 2]
    return point


def local_to_earth(points: Float64, latitude: Float64, longitude: Float64) -> Float64:
    """Transform east, north, up [m] (P, 3), with an origin of height 0 per point, to earth-centred coordinates.

    Args:
        points: (P, 3).
        latitude, longitude: (P,) geodetic coordinates of the origins [rad].
    """
    origin, axes = on_ellipsoid(latitude, longitude), _axes(latitude, longitude)
    turned: Float64 = origin + np.einsum("pi,pij->pj", points, axes)
    return turned


def _axes(latitude: Float64, longitude: Float64) -> Float64:
    """(K, 3, 3) unit vectors east, north and up."""
    sin_lat, cos_lat, sin_lng, cos_lng = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    east = np.stack([-sin_lng, cos_lng, np.zeros_like(latitude)], axis=-1)
    north = np.stack([-sin_lat * cos_lng, -sin_lat * sin_lng, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lng, cos_lat * sin_lng, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=1)
