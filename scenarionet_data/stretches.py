"""Along which stretch of a lane a boundary or neighbour lies: short rows in ``extras``, Waymo's records elsewhere.

Waymo's lanes name boundaries and neighbours with the indices of the points where they begin and end. ScenarioNet's
pickles hold them as dictionaries of str, 150 kB of text a scenario; a lane's ``extras`` hold the same as rows:

    "left_boundaries": [[first point, last point, feature_id, type code], ...]
    "left_neighbor":   [[feature_id, own first, own last, its first, its last, [boundary rows]], ...]
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenarionet_data.vocabulary import MapFeatureType

BOUNDARIES = ("left_boundaries", "right_boundaries")
NEIGHBORS = ("left_neighbor", "right_neighbor")

_BOUNDARY_KEYS = ("lane_start_index", "lane_end_index", "boundary_feature_id", "boundary_type")
_NEIGHBOR_KEYS = ("feature_id", "self_start_index", "self_end_index", "neighbor_start_index", "neighbor_end_index")


def to_rows(extras: Mapping[str, Any]) -> dict[str, Any]:
    """A lane's extras with rows in place of records; records of another form stay as they are."""
    rows = dict(extras)
    for name in BOUNDARIES:
        if _are_records(rows.get(name), _BOUNDARY_KEYS):
            rows[name] = [_boundary_row(record) for record in rows[name]]
    for name in NEIGHBORS:
        if _are_records(rows.get(name), (*_NEIGHBOR_KEYS, "boundaries")):
            rows[name] = [_neighbor_row(record) for record in rows[name]]
    return rows


def to_records(extras: Mapping[str, Any]) -> dict[str, Any]:
    """A lane's extras with records, every value a str, in place of rows: what :func:`to_rows` took apart."""
    records = dict(extras)
    for name in BOUNDARIES:
        if name in records:
            records[name] = [_boundary_record(row) for row in records[name]]
    for name in NEIGHBORS:
        if name in records:
            records[name] = [_neighbor_record(row) for row in records[name]]
    return records


def _are_records(value: Any, keys: tuple[str, ...]) -> bool:
    """Whether every item has exactly these keys, and indices that are whole numbers."""
    return bool(value) and all(
        isinstance(item, dict)
        and set(item) == set(keys)
        and all(str(item[key]).isdecimal() for key in keys if key.endswith("_index"))
        and item.get("boundary_type", "UNKNOWN") in MapFeatureType.__members__
        and ("boundaries" not in keys or not item["boundaries"] or _are_records(item["boundaries"], _BOUNDARY_KEYS))
        for item in value
    )


def _boundary_row(record: Mapping[str, Any]) -> list[Any]:
    first, last, feature_id, name = (record[key] for key in _BOUNDARY_KEYS)
    return [int(first), int(last), str(feature_id), int(MapFeatureType[name])]


def _boundary_record(row: Any) -> Any:
    if isinstance(row, dict):
        return row
    first, last, feature_id, code = row
    return dict(zip(_BOUNDARY_KEYS, (str(first), str(last), feature_id, MapFeatureType(code).name), strict=True))


def _neighbor_row(record: Mapping[str, Any]) -> list[Any]:
    feature_id, *indices = (record[key] for key in _NEIGHBOR_KEYS)
    boundaries = [_boundary_row(boundary) for boundary in record["boundaries"]]
    return [str(feature_id), *(int(index) for index in indices), boundaries]


def _neighbor_record(row: Any) -> Any:
    if isinstance(row, dict):
        return row
    *values, boundaries = row
    record: dict[str, Any] = dict(zip(_NEIGHBOR_KEYS, map(str, values), strict=True))
    return record | {"boundaries": [_boundary_record(boundary) for boundary in boundaries]}
