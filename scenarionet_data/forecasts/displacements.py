"""Displacement scores of one target, as Argoverse and nuScenes define them.

Sources: https://github.com/argoverse/av2-api, ``datasets/motion_forecasting/eval/metrics.py``, and the leaderboard of
Argoverse 2 (the best mode has the smallest error at the end); https://github.com/nutonomy/nuscenes-devkit,
``eval/prediction/metrics.py``.
"""

from __future__ import annotations

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import AREAS_TO_DRIVE_ON, MapFeatureType, is_lane

MISS = 2.0
"""Error beyond which a prediction misses, or in nuScenes from which [m]."""
ARGOVERSE_MODES = 6
_PIXELS, _SPLINE_ORDER = 10.0, 3


def argoverse(modes: Float64, probabilities: Float64, truth: Float64) -> dict[str, float]:
    """Scores of Argoverse 1 and 2.

    Args:
        modes: (K, F, 2) [m], by descending probability; the first 6 count.
        probabilities: (K,) whose sum is 1.
        truth: (F, 2) [m].

    Returns:
        ``min_fde``: smallest error at the end [m]; ``min_ade``: mean error of that mode [m]; ``is_missed``: 1 if
        min_fde is above 2 m; ``brier_min_fde``: min_fde plus (1 - probability)^2 of that mode; ``min_fde_1`` and
        ``is_missed_1``: of the most probable mode alone, as leaderboards with K = 1 rank.
    """
    error = np.linalg.norm(modes[:ARGOVERSE_MODES] - truth, axis=-1)
    best = int(np.argmin(error[:, -1]))
    final = float(error[best, -1])
    return {
        "min_ade": float(error[best].mean()),
        "min_fde": final,
        "is_missed": float(final > MISS),
        "brier_min_fde": final + float(1 - probabilities[best]) ** 2,
        "min_fde_1": float(error[0, -1]),
        "is_missed_1": float(error[0, -1] > MISS),
    }


def nuscenes(modes: Float64, truth: Float64, count: int) -> dict[str, float]:
    """Scores of nuScenes over the ``count`` most probable modes.

    Returns:
        ``min_ade_k``: smallest mean error [m]; ``miss_rate_top_k``: 1 if every mode is at least 2 m away at some
        time.
    """
    error = np.linalg.norm(modes[:count] - truth, axis=-1)
    missed = float((error.max(axis=1) >= MISS).all())
    return {f"min_ade_{count}": float(error.mean(axis=1).min()), f"miss_rate_top_{count}": missed}


def off_road_rate(modes: Float64, area: shapely.Geometry, origin: Float64) -> float:
    """Share of the modes that leave the drivable area, as nuScenes' OffRoadRate: between the predicted points, too.

    The owner draws the area with pixels of 0.1 m; here only the points are on that grid, the outline is exact.

    Args:
        modes: (K, F, 2) [m].
        area: See :func:`drivable_area`.
        origin: (2,) place of the scenario's frame in that of the source, in which the grid is [m].

    Raises:
        ImportError: Without scipy, whose splines are the owner's.
    """
    from scipy.interpolate import splev, splprep

    left = 0
    for mode in modes:
        points = np.array(list(dict.fromkeys(map(tuple, mode.tolist()))))  # different ones, as the spline needs
        if len(points) > _SPLINE_ORDER:
            knots, _ = splprep(points.T, k=_SPLINE_ORDER, s=0.1)
            points = np.column_stack(splev(np.linspace(0.0, 1.0, 200), knots))
        points = np.trunc((points + origin) * _PIXELS) / _PIXELS - origin
        left += not shapely.intersects_xy(area, points[:, 0], points[:, 1]).all()
    return left / len(modes)


def drivable_area(features: MapFeatures | None) -> shapely.Geometry | None:
    """Union of a map's lanes and areas to drive on; None if it does not outline the road.

    Maps of centrelines only (Waymo) may outline driveways: with these alone, every path would leave the road.
    """
    if features is None:
        return None
    has_outline, lanes = features.polygon.lengths >= 3, is_lane(features.feature_type)
    has_area = bool((has_outline & (features.feature_type == MapFeatureType.DRIVABLE_AREA)).any())
    if not has_area and not (lanes.any() and has_outline[lanes].all()):
        return None
    rows = np.flatnonzero((lanes | np.isin(features.feature_type, AREAS_TO_DRIVE_ON)) & has_outline).tolist()
    outlines = [shapely.make_valid(shapely.Polygon(features.polygon[row][:, :2])) for row in rows]
    area = shapely.union_all(outlines)
    shapely.prepare(area)
    return area
