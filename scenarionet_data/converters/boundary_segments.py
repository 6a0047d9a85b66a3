"""Segments of a lane along its boundaries and neighbours: compact rows in ``extras``, converted from Waymo's records.

Waymo's lanes list boundaries and neighbours with the indices of their first and last points. ScenarioNet's pickles
store them as dictionaries of str, 150 kB of text per scenario; a lane's ``extras`` store the same as rows:

    "left_boundaries": [[first point, last point, feature_id, type code], ...]
    "left_neighbor":   [[feature_id, own first, own last, its first, its last, [boundary rows]], ...]
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from operator import itemgetter
from typing import Any

from scenarionet_data.scenario.vocabulary import MapFeatureType

BOUNDARIES = ("left_boundaries", "right_boundaries")
NEIGHBORS = ("left_neighbor", "right_neighbor")

_BOUNDARY_KEYS = ("lane_start_index", "lane_end_index", "boundary_feature_id", "boundary_type")
_CODES = {name: int(code) for name, code in MapFeatureType.__members__.items()}
_NEIGHBOR_KEYS = ("feature_id", "self_start_index", "self_end_index", "neighbor_start_index", "neighbor_end_index")
_boundary_values, _neighbor_values = itemgetter(*_BOUNDARY_KEYS), itemgetter(*_NEIGHBOR_KEYS, "boundaries")


def to_rows(extras: Mapping[str, Any]) -> dict[str, Any]:
    """Replace records in a lane's extras by rows; keep records of any other form."""
    if not extras:
        return {}
    rows = dict(extras)
    for names, to_row in ((BOUNDARIES, _boundary_row), (NEIGHBORS, _neighbor_row)):
        for name in names:
            if rows.get(name):
                with suppress(*_OTHER_FORM):
                    rows[name] = list(map(to_row, rows[name]))
    return rows


def to_records(extras: Mapping[str, Any]) -> dict[str, Any]:
    """Replace rows in a lane's extras by records with str values: the inverse of :func:`to_rows`."""
    records = dict(extras)
    for name in BOUNDARIES:
        if name in records:
            records[name] = [_boundary_record(row) for row in records[name]]
    for name in NEIGHBORS:
        if name in records:
            records[name] = [_neighbor_record(row) for row in records[name]]
    return records


_OTHER_FORM = (KeyError, TypeError, ValueError)
"""Errors raised for records with other keys or with indices that are not integers."""


def _boundary_row(record: Any) -> list[Any]:
    first, last, feature_id, name = _boundary_values(record)
    if len(record) != len(_BOUNDARY_KEYS) or not _is_decimal(first, last) or type(feature_id) is not str:
        raise ValueError(record)
    return [int(first), int(last), feature_id, _CODES[name]]


def _neighbor_row(record: Any) -> list[Any]:
    feature_id, first, last, other_first, other_last, boundaries = _neighbor_values(record)
    is_decimal = _is_decimal(first, last, other_first, other_last)
    if len(record) != len(_NEIGHBOR_KEYS) + 1 or not is_decimal or type(feature_id) is not str:
        raise ValueError(record)
    indices = int(first), int(last), int(other_first), int(other_last)
    return [feature_id, *indices, [_boundary_row(boundary) for boundary in boundaries]]


def _is_decimal(*indices: Any) -> bool:
    """Whether indices are text, as in ScenarioNet's records: others would come back as text."""
    return set(map(type, indices)) == {str} and "".join(indices).isdecimal()


def _boundary_record(row: Any) -> Any:
    if isinstance(row, dict):
        return row
    first, last, feature_id, code = row
    return dict(zip(_BOUNDARY_KEYS, (str(first), str(last), feature_id, MapFeatureType(code).name), strict=True))


def _neighbor_record(row: Any) -> Any:
    if isinstance(row, dict):
        return row
    *values, boundaries = row
    record: dict[str, Any] = dict(zip(_NEIGHBOR_KEYS, map(str, values), strict=True))
    return record | {"boundaries": [_boundary_record(boundary) for boundary in boundaries]}
