"""Names, numbers and limits of GPUDrive's JSON (Emerge-Lab/gpudrive: ``src/init.hpp``, ``data_utils``)."""

from __future__ import annotations

from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

NUM_STEPS = 91
HISTORY = 10
"""Timesteps before the current one."""

MAX_OBJECTS, MAX_ROADS, MAX_POINTS = 515, 956, 1746
"""What GPUDrive reads of a file: objects, roads, points of a road."""

INVALID = -10_000.0
"""Coordinate, heading and velocity of states that are not valid."""

OBJECT_NAMES = {ObjectType.VEHICLE: "vehicle", ObjectType.PEDESTRIAN: "pedestrian", ObjectType.CYCLIST: "cyclist"}

ROADS = {
    MapFeatureType.LANE_UNKNOWN: ("lane", 0),
    MapFeatureType.LANE_FREEWAY: ("lane", 1),
    MapFeatureType.LANE_SURFACE_STREET: ("lane", 2),
    MapFeatureType.LANE_SURFACE_UNSTRUCTURE: ("lane", 2),
    MapFeatureType.LANE_BIKE_LANE: ("lane", 3),
    MapFeatureType.UNKNOWN_LINE: ("road_line", 5),
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: ("road_line", 6),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE: ("road_line", 7),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: ("road_line", 8),
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: ("road_line", 9),
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: ("road_line", 10),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW: ("road_line", 11),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: ("road_line", 12),
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: ("road_line", 13),
    MapFeatureType.UNKNOWN: ("road_edge", 14),
    MapFeatureType.ROAD_EDGE_BOUNDARY: ("road_edge", 15),
    MapFeatureType.ROAD_EDGE_MEDIAN: ("road_edge", 16),
    MapFeatureType.ROAD_EDGE_SIDEWALK: ("road_edge", 15),
    MapFeatureType.GUARDRAIL: ("road_edge", 15),
    MapFeatureType.STOP_SIGN: ("stop_sign", 17),
    MapFeatureType.CROSSWALK: ("crosswalk", 18),
    MapFeatureType.SPEED_BUMP: ("speed_bump", 19),
    MapFeatureType.DRIVEWAY: ("driveway", 20),
}
"""Type and ``map_element_id`` of each map feature, numbered as in Waymo's and Waymax's road graph."""

FEATURES = {number: feature for feature, (_, number) in reversed(ROADS.items())}
"""The first feature type of each ``map_element_id``."""

FEATURE_OF_TYPE = {
    "lane": MapFeatureType.LANE_SURFACE_STREET,
    "road_line": MapFeatureType.UNKNOWN_LINE,
    "road_edge": MapFeatureType.ROAD_EDGE_BOUNDARY,
    "stop_sign": MapFeatureType.STOP_SIGN,
    "crosswalk": MapFeatureType.CROSSWALK,
    "speed_bump": MapFeatureType.SPEED_BUMP,
    "driveway": MapFeatureType.DRIVEWAY,
}
"""The same for Nocturne's files, which have no ``map_element_id``."""
