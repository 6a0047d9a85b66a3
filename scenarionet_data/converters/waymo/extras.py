"""Write the extras of map features as JSON text.

The text equals ``canonical_json.to_json`` of the rows of ``boundary_segments``; building a dictionary per boundary
would take longer than the rest of a record.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int64, Object
from scenarionet_data.converters.waymo.wire import WaymoWireMap


def write_extras(features: WaymoWireMap, boundary_codes: Int64) -> Object:
    """(M,) JSON text per feature, None if it has no extras.

    Args:
        features: A record's map.
        boundary_codes: ``MapFeatureType`` by the source's boundary type.
    """
    members = [',"interpolating":true' if flag else "" for flag in features.is_interpolating.tolist()]
    for side in ("left", "right"):
        boundaries, neighbors, inner = (
            getattr(features, f"{side}_{name}") for name in ("boundaries", "neighbors", "neighbor_boundaries")
        )
        for row, text in _by_owner(boundaries, _boundaries(boundaries, boundary_codes)):
            members[row] += f',"{side}_boundaries":[{text}]'
        segments = dict(_by_owner(inner, _boundaries(inner, boundary_codes)))
        rows = np.column_stack(
            [neighbors[:, 1:].astype(object), [segments.get(row, "") for row in range(len(neighbors))]]
        )
        for row, text in _by_owner(neighbors, _texts(_NEIGHBOR, rows)):
            members[row] += f',"{side}_neighbor":[{text}]'
    return np.array([f"{{{text[1:]}}}" if text else None for text in members], dtype=object)


_BOUNDARY = '[%d,%d,"%d",%d]'
_NEIGHBOR = '["%d",%d,%d,%d,%d,[%s]]'


def _boundaries(table: Int64, codes: Int64) -> list[str]:
    """Text of each boundary: first and last point, feature, type code."""
    return _texts(_BOUNDARY, np.column_stack([table[:, 1:4], codes[table[:, 4]]]))


def _texts(form: str, rows: Array) -> list[str]:
    """Format each row; one format for all is several times as fast as one for each."""
    return ("\n".join([form] * len(rows)) % tuple(rows.ravel().tolist())).split("\n") if len(rows) else []


def _by_owner(table: Int64, texts: list[str]) -> Iterator[tuple[int, str]]:
    """Yield each owner that the first column of a table names, ascending, with its texts."""
    owners, first = np.unique(table[:, 0], return_index=True)
    parts = (",".join(texts[start:end]) for start, end in pairwise([*first.tolist(), len(texts)]))
    return zip(owners.tolist(), parts, strict=True)
