"""Read maps as GeoJSON: lines and areas, whose properties say what they are.

    {"type": "Feature", "id": "12",
     "geometry": {"type": "LineString", "coordinates": [[0, 0], [50, 0]]},
     "properties": {"type": "LANE_SURFACE_STREET", "width": 3.5, "speed_limit": 13.9, "exit_lanes": ["13"]}}

``type`` is a name of ``MapFeatureType``, or one of the short ones below. Lengths are metres, speeds m/s. Links and
neighbours are what ``entry_lanes``, ``exit_lanes``, ``left_neighbors`` ... say; none is guessed from where lines end.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.converters.cities import complete_links
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.description import ID_LISTS
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type

TYPES = {
    "LANE": Type.LANE_SURFACE_STREET,
    "ROAD_LINE": Type.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "ROAD_EDGE": Type.ROAD_EDGE_BOUNDARY,
    **Type.__members__,
}
_LINES, _AREAS = ("LineString", "Point"), ("Polygon",)


def read_geojson(path: Path, to_metres: Callable[[Float64, Float64], Float64] | None = None) -> MapBuilder:
    """Read a map; what cannot be used is left out and listed in its ``defects``.

    Args:
        path: The file.
        to_metres: Makes points (n, 2) [m] of longitudes and latitudes (n,) [degrees]; None for maps in metres.

    Raises:
        CorruptSource: No GeoJSON, or nothing in it that can be used.
    """
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise CorruptSource(f"{path}: expected GeoJSON, found none that can be read ({error})") from error
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(features, list):
        raise CorruptSource(f"{path}: expected GeoJSON, a FeatureCollection with features, found none")
    builder, defects = MapBuilder(), Defects()
    found = list(_features(features, path.name, to_metres, defects))
    points = np.concatenate([np.zeros((0, 3)), *(geometry for *_, geometry in found)])
    middle = np.median(points[:, :2], axis=0) if len(points) else np.zeros(2)
    usable = []
    for each in found:
        reason = find_bad_geometry(each[-1], middle)
        if reason:
            defects.drop("maps", path.name, [each[0]], "coordinates", reason)
        else:
            usable.append(each)
    if not usable:
        raise CorruptSource(f"{path}: expected lanes, lines or areas, found none that can be used")
    links = {name: {key: _ids(told.get(name)) for key, _, told, _, _ in usable} for name in ID_LISTS}
    complete_links(links["entry_lanes"], links["exit_lanes"])
    for key, kind, told, is_line, geometry in usable:
        width = _positive(told.get("width")) / 2.0
        builder.add(
            key,
            kind,
            polyline=geometry if is_line else None,
            polygon=None if is_line else geometry,
            speed_limit=_positive(told.get("speed_limit")),
            width=None if np.isnan(width) else np.full(2, width),
            entry_lanes=links["entry_lanes"][key],
            exit_lanes=links["exit_lanes"][key],
            left_neighbors=links["left_neighbors"][key],
            right_neighbors=links["right_neighbors"][key],
            left_boundaries=links["left_boundaries"][key],
            right_boundaries=links["right_boundaries"][key],
            controlled_lanes=links["controlled_lanes"][key],
        )
    builder.defects = defects.found()
    return builder


def _features(
    features: list[Any], file: str, to_metres: Callable[[Float64, Float64], Float64] | None, defects: Defects
) -> Iterator[tuple[str, Type, Mapping[str, Any], bool, Float64]]:
    """Id, type, properties, whether it is a line, and points (n, 3) [m] of each feature that can be read."""
    seen = set[str]()
    for number, feature in enumerate(features):
        told = _mapping(feature)
        properties, geometry = _mapping(told.get("properties")), _mapping(told.get("geometry"))
        key = str(told.get("id", properties.get("id", f"feature-{number}")))
        word, shape = properties.get("type"), geometry.get("type")
        kind = TYPES.get(word.upper()) if isinstance(word, str) else None
        points = geometry.get("coordinates")
        if shape == "Polygon" and isinstance(points, list) and points:
            points = points[0]
        elif shape == "Point":
            points = [points]
        where = [key[:64]]
        if kind is None:
            defects.drop("maps", file, where, "type", f"expected one of {', '.join(TYPES)}, found {str(word)[:64]}")
        elif key in seen:
            defects.drop("maps", file, where, "id", "expected an id of its own, found it twice")
        elif shape not in (*_LINES, *_AREAS):
            expected = ", ".join((*_LINES, *_AREAS))
            defects.drop("maps", file, where, "geometry", f"expected {expected}, found {str(shape)[:64]}")
        elif (array := _points(points, shape)) is None:
            defects.drop("maps", file, where, "coordinates", "expected points of two or three numbers, found others")
        else:
            seen.add(key)
            if to_metres is not None:
                is_on_earth = (np.abs(array[:, :2]) <= np.array([180.0, 90.0])).all(axis=1)
                array[~is_on_earth, :2] = np.nan
                array[:, :2] = to_metres(array[:, 0], array[:, 1])
            yield key, kind, properties, shape in _LINES, array


def _points(points: Any, shape: str) -> Float64 | None:
    """(n, 3) coordinates, z = 0 where there is none; None if they are none."""
    try:
        array = np.array(points, np.float64)
    except (TypeError, ValueError, OverflowError):
        return None
    fewest = {"Point": 1, "LineString": 2, "Polygon": 3}[shape]
    if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) < fewest:
        return None
    return np.column_stack([array, np.zeros((len(array), 3 - array.shape[1]))])


def _mapping(told: Any) -> Mapping[str, Any]:
    return told if isinstance(told, dict) else {}


def _ids(told: Any) -> list[str]:
    return [str(each) for each in told if isinstance(each, str | int)] if isinstance(told, list) else []


def _positive(told: Any) -> float:
    """A number above 0; NaN for anything else."""
    is_number = isinstance(told, int | float) and not isinstance(told, bool) and 0 < told < 1e6
    return float(told) if is_number else np.nan
