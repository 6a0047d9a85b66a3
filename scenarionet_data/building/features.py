"""Build canonical map features from columns with one value or one list per feature."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.precision import METRES, WIDTHS, rounded
from scenarionet_data.scenario.description import ID_LISTS, MapFeatures, strings


def make_features(
    ids: Iterable[Any],
    types: npt.ArrayLike,
    *,
    polyline: Ragged,
    polygon: Ragged,
    width: Ragged,
    speed_limit: npt.ArrayLike,
    links: Mapping[str, Ragged],
    is_intersection: npt.ArrayLike,
    extras: Sequence[str | None],
    origin: Float64,
    has_z: bool,
) -> MapFeatures:
    """Build map features as float32 offsets from ``origin``.

    Args:
        ids: (M,) unique within the map.
        types: (M,) codes of ``MapFeatureType``.
        polyline, polygon: M lists of points (P, 3) float64 [m], source frame.
        width: M lists of (k, 2) [m] from the centreline to the left and right side; k is 0, 1 or the number of points.
        speed_limit: (M,) [m/s], NaN when unknown.
        links: M lists of ids by name in ``ID_LISTS``; missing names are empty lists.
        is_intersection: (M,) 1 yes, 0 no, -1 unknown.
        extras: (M,) JSON text or None.
        origin: (3,) float64 [m].
        has_z: If False, every z is set to 0.
    """

    def offsets(points: Ragged) -> Ragged:
        values = points.values - origin
        if not has_z:
            values[:, 2] = 0.0
        return Ragged(points.offsets, rounded(values, METRES))

    codes = np.asarray(types, dtype=np.uint8)
    none = Ragged.empty(len(codes))
    return MapFeatures(
        ids=strings(ids),
        feature_type=codes,
        polyline=offsets(polyline),
        polygon=offsets(polygon),
        speed_limit=np.asarray(speed_limit, dtype=np.float32),
        width=_widths(width),
        **{name: links.get(name, none) for name in ID_LISTS},
        is_intersection=np.asarray(is_intersection, dtype=np.int8),
        extras=np.array(extras, dtype=object),
    )


def _widths(width: Ragged) -> Ragged:
    """Round widths given per point; keep a lane's single width exactly."""
    is_one_for_all = np.repeat(width.lengths == 1, width.lengths)[:, None]
    exact = width.values.astype(np.float32)
    return Ragged(width.offsets, np.where(is_one_for_all, exact, rounded(width.values, WIDTHS)))


def flat_points(lines: Sequence[Any], height: float = 0.0) -> Ragged:
    """Return lines as M lists of points (P, 3) float64 [m]; batched, as a NumPy call costs the same for one as for all.

    Args:
        lines: (M,) each None, empty, or (n, 2) or (n, 3) as an array or as a list of points.
        height: z of 2D points.

    Raises:
        ValueError: Points have neither 2 nor 3 coordinates, or a line mixes both.
    """
    lengths = np.array([0 if line is None else len(line) for line in lines], np.int64)
    forms: dict[tuple[bool, int], list[int]] = {}
    for row in np.flatnonzero(lengths).tolist():
        is_array = isinstance(lines[row], np.ndarray)
        form = is_array, lines[row].shape[1] if is_array else len(lines[row][0])
        forms.setdefault(form, []).append(row)
    points = np.zeros((int(lengths.sum()), 3))
    points[:, 2] = height
    for (is_array, width), rows in forms.items():
        if width not in (2, 3):
            raise ValueError(f"expected points with 2 or 3 coordinates, found {width}")
        chosen = [lines[row] for row in rows]
        values = np.concatenate(chosen) if is_array else _stacked(chosen, width)
        if len(forms) == 1:
            points[:, :width] = values
        else:
            is_of_form = np.zeros(len(lines), np.bool_)
            is_of_form[rows] = True
            points[np.repeat(is_of_form, lengths), :width] = values
    return Ragged.from_flat(lengths, points)


def _stacked(lines: Sequence[Sequence[Sequence[float]]], width: int) -> Float64:
    """Concatenate lists of points to (P, width); twice as fast as letting NumPy infer the shape."""
    points = list(chain.from_iterable(lines))
    if set(map(len, points)) != {width}:
        raise ValueError(f"expected {width} coordinates for every point, as for the first")
    return np.fromiter(chain.from_iterable(points), np.float64, width * len(points)).reshape(-1, width)
