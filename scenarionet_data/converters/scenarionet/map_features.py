"""Read map features from ScenarioNet pickles of every version, column by column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import flat_points, make_features
from scenarionet_data.converters.boundary_segments import to_rows
from scenarionet_data.converters.scenarionet.frame import Frame
from scenarionet_data.converters.scenarionet.layout import LAYOUT, LINKS
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.description import MapFeatures, strings
from scenarionet_data.scenario.vocabulary import MapFeatureType

# Speed limits that ScenarioNet and MetaDrive write for unknown ones [km/h].
_INVENTED_LIMITS = {"nuscenes": (100.0,), "av2": (85.0 * 1.609344,), "metadrive": (1000.0, 100.0)}
_FEATURE_TYPES = dict(MapFeatureType.__members__)
_LISTS = (list, tuple, np.ndarray)
_ID_KEYS = ("feature_id", "boundary_feature_id", "id")

Feature = Mapping[str, Any]


def is_known(feature: Feature) -> bool:
    """Whether the lake has the type of a map feature."""
    return str(feature["type"]) in _FEATURE_TYPES


def make_map(features: Mapping[Any, Feature], frame: Frame, own: Sequence[dict[str, Any]]) -> MapFeatures | None:
    """Build canonical map features.

    Args:
        features: Those of ``description["map_features"]`` whose type is known.
        frame: Their frame.
        own: (M,) what the layout keeps with them.

    Returns:
        The map, or None if there are no features.
    """
    if not features:
        return None
    known = list(features.values())
    keys: set[str] = set().union(*known)  # most datasets have few of the keys, and each takes a pass over the map
    links = {key: [_listed(feature.get(key)) for feature in known] for key in LINKS if key in keys}
    extras = _extras(known, links, frame.is_ours)
    lines = _points([feature.get("position", feature.get("polyline")) for feature in known], frame)
    if frame.moved.any():
        is_sign = np.array(["position" in feature for feature in known])
        lines.values[np.repeat(is_sign, lines.lengths)] += frame.moved
    outlines = _points([feature.get("polygon") for feature in known], frame)
    for row, feature in enumerate(known):
        if "polygon_z" in feature:
            outlines[row][:, 2] = feature["polygon_z"]
    is_lane = np.array([str(feature["type"]).startswith("LANE_") for feature in known])
    exact = np.array([feature.get("speed_limit_mps") or np.nan for feature in known], np.float64)
    kmh = np.array([_kmh(feature) or np.nan for feature in known], np.float64)
    for invented in _INVENTED_LIMITS.get(frame.quirks, ()):
        kmh[np.abs(kmh - invented) < 1e-3] = np.nan
    limits: Float64 = np.where(is_lane, np.where(np.isnan(exact), kmh / 3.6, exact), np.nan)
    return make_features(
        list(features),
        [_FEATURE_TYPES[str(feature["type"])] for feature in known],
        polyline=lines,
        polygon=outlines,
        width=_widths(known) if "width" in keys else Ragged.empty(len(known), width=2),
        speed_limit=limits,
        links={LINKS[key]: _ids(lists) for key, lists in links.items()},
        is_intersection=[-1 if (told := feature.get("is_intersection")) is None else int(told) for feature in known],
        extras=[
            to_json(to_rows(found) | ({LAYOUT: kept} if kept else {})) for found, kept in zip(extras, own, strict=True)
        ],
        origin=frame.local_origin,
        has_z=frame.has_z,
    )


def _points(lines: Sequence[Any], frame: Frame) -> Ragged:
    """M lists of points (P, 3) float64 [m] from lists, arrays or single points."""
    points = flat_points([np.reshape(line, (1, -1)) if _is_point(line) else line for line in lines], frame.ground)
    if frame.quirks == "nuscenes":  # its lanes are (x, y, heading); its map has no heights
        points.values[:, 2] = frame.ground
    return points


def _is_point(line: Any) -> bool:
    if isinstance(line, np.ndarray):
        return line.ndim == 1 and line.size > 0
    return line is not None and len(line) > 0 and isinstance(line[0], (int, float, np.number))


def _widths(features: Sequence[Feature]) -> Ragged:
    """Widths; dropped if all are 0, as in Argoverse 2 pickles."""
    widths = [_pairs(feature.get("width"))[: 1 if feature.get("is_width_constant") else None] for feature in features]
    pairs = Ragged.from_flat(list(map(len, widths)), np.concatenate(widths, dtype=np.float64))
    wide = np.zeros(len(features), np.bool_)
    is_set = (pairs.values[:, 0] != 0) | (pairs.values[:, 1] != 0)
    wide[np.repeat(np.arange(len(features)), pairs.lengths)[is_set]] = True
    return Ragged.from_flat(np.where(wide, pairs.lengths, 0), pairs.values[np.repeat(wide, pairs.lengths)])


def _pairs(width: Any) -> Array:
    """(k, 2) from a list, an array or a single pair; (0, 2) from None or 0."""
    if np.ndim(width) == 2:
        return np.asarray(width)
    return np.zeros((0, 2)) if width is None or (np.ndim(width) == 0 and not width) else np.reshape(width, (-1, 2))


def _listed(items: Any) -> Sequence[Any]:
    """A list from a list of ids (int or str), a list of Waymo's records, or a single id."""
    if type(items) is list:
        return items
    return () if items is None else list(items) if isinstance(items, _LISTS) else [items]


def _ids(lists: Sequence[Sequence[Any]]) -> Ragged:
    """Ids in the lists of all features."""
    flat = [_id(item) if isinstance(item, dict) else item for item in chain.from_iterable(lists)]
    return Ragged.from_flat(list(map(len, lists)), strings(flat))


def _id(record: Mapping[str, Any]) -> Any:
    for key in _ID_KEYS:
        if key in record:
            return record[key]
    raise KeyError(_ID_KEYS[0])


def _extras(
    features: Sequence[Feature], links: Mapping[str, Sequence[Sequence[Any]]], is_ours: bool
) -> list[dict[str, Any]]:
    """Return the extras of this project's export, or the segments in Waymo's records.

    Segments are the first and last point of a neighbour or boundary along the lane.
    """
    if is_ours:
        return [feature.get("extras") or {} for feature in features]
    extras: list[dict[str, Any]] = [
        {"interpolating": True} if feature.get("interpolating") is True else {} for feature in features
    ]
    for key, lists in links.items():
        for found, items in zip(extras, lists, strict=True):
            if items and isinstance(items[0], dict):  # all items of a list have the same form
                found[key] = items
    return extras


def _kmh(feature: Feature) -> float | None:
    kmh = feature.get("speed_limit_kmh")
    if kmh is None and feature.get("speed_limit_mph"):
        return float(feature["speed_limit_mph"] * 1.609344)
    return kmh
