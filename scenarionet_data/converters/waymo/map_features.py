"""Convert the map of a Waymo scenario: types, units, ids as str, polylines and polygons.

Works on whole columns instead of ``building.MapBuilder``: a record has hundreds of features and a thousand links, and
a budget of three milliseconds.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import METRES, offsets_from, rounded
from scenarionet_data.converters.waymo.extras import write_extras
from scenarionet_data.converters.waymo.wire import (
    CROSSWALK,
    DRIVEWAY,
    LANE,
    ROAD_EDGE,
    ROAD_LINE,
    SPEED_BUMP,
    STOP_SIGN,
    WaymoWireMap,
)
from scenarionet_data.scenario.description import MapFeatures, strings
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type

MPH = 0.44704
"""One mile per hour [m/s]."""

_TYPES = {
    LANE: (Type.LANE_UNKNOWN, Type.LANE_FREEWAY, Type.LANE_SURFACE_STREET, Type.LANE_BIKE_LANE),
    ROAD_LINE: (
        Type.UNKNOWN_LINE,
        Type.ROAD_LINE_BROKEN_SINGLE_WHITE,
        Type.ROAD_LINE_SOLID_SINGLE_WHITE,
        Type.ROAD_LINE_SOLID_DOUBLE_WHITE,
        Type.ROAD_LINE_BROKEN_SINGLE_YELLOW,
        Type.ROAD_LINE_BROKEN_DOUBLE_YELLOW,
        Type.ROAD_LINE_SOLID_SINGLE_YELLOW,
        Type.ROAD_LINE_SOLID_DOUBLE_YELLOW,
        Type.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    ),
    ROAD_EDGE: (Type.UNKNOWN, Type.ROAD_EDGE_BOUNDARY, Type.ROAD_EDGE_MEDIAN),
    STOP_SIGN: (Type.STOP_SIGN,),
    CROSSWALK: (Type.CROSSWALK,),
    SPEED_BUMP: (Type.SPEED_BUMP,),
    DRIVEWAY: (Type.DRIVEWAY,),
}
"""``MapFeatureType`` by kind of feature and value of the kind's enum."""

# A boundary of unknown type is a road edge (map.proto), which MetaDrive calls UNKNOWN.
_BOUNDARY_CODES = np.array([int(Type.UNKNOWN), *map(int, _TYPES[ROAD_LINE][1:])])


def map_features(features: WaymoWireMap, is_bad: Bool, origin: Float64) -> MapFeatures | None:
    """Build the usable features in the scenario frame; None if there are none.

    A speed limit of 0, as on bike lanes, means unknown. The segments of boundaries and neighbours go to ``extras``, see
    ``boundary_segments``.

    Args:
        features: As decoded, in the source frame.
        is_bad: (M,) features to leave out.
        origin: (3,) [m].
    """
    count = len(features.ids)
    if is_bad.all():
        return None
    points = rounded(offsets_from(origin, features.points), METRES)
    is_line = features.kinds <= STOP_SIGN
    limit = np.where(features.speed_limit > 0, features.speed_limit * MPH, np.nan)

    def ids(links: Int64, column: int) -> Ragged:
        return Ragged.from_flat(np.bincount(links[:, 0], minlength=count), strings(links[:, column].tolist()))

    codes = np.zeros(len(features.kinds), np.uint8)
    for kind, table in _TYPES.items():
        mask = features.kinds == kind
        codes[mask] = np.array(table, np.uint8)[features.types[mask]]
    found = MapFeatures(
        ids=strings(features.ids.tolist()),
        feature_type=codes,
        polyline=_geometry(points, features.num_points, is_line),
        polygon=_geometry(points, features.num_points, ~is_line),
        speed_limit=limit.astype(np.float32),
        width=Ragged.empty(count, width=2),
        entry_lanes=ids(features.entry_lanes, 1),
        exit_lanes=ids(features.exit_lanes, 1),
        left_neighbors=ids(features.left_neighbors, 1),
        right_neighbors=ids(features.right_neighbors, 1),
        left_boundaries=ids(features.left_boundaries, 3),
        right_boundaries=ids(features.right_boundaries, 3),
        controlled_lanes=ids(features.controlled_lanes, 1),
        is_intersection=np.full(count, -1, np.int8),
        extras=write_extras(features, _BOUNDARY_CODES),
    )
    return found.take(np.flatnonzero(~is_bad)) if is_bad.any() else found


def _geometry(points: Float32, num_points: Int64, mask: Bool) -> Ragged:
    """Points of the features where ``mask`` (M,) is True; empty lists for the others."""
    return Ragged.from_flat(np.where(mask, num_points, 0), points.compress(np.repeat(mask, num_points), axis=0))
