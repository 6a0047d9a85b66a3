"""Vocabulary of nuPlan mapped to the lake's: objects, traffic lights, lanes, painted lines, areas.

Names and numbers from nuplan-devkit (``nuplan/database/utils/label``, ``nuplan/common/maps``,
``nuplan/common/actor_state/vehicle_parameters.py``).
"""

from __future__ import annotations

from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType

EGO = "ego"
EGO_SIZE = (5.176, 2.297, 1.777)
"""Length, width, height [m] of the recording vehicle, a Chrysler Pacifica."""
REAR_AXLE_TO_CENTER = 1.461
"""Distance along the heading from the rear axle, the reference point of the log, to the centre of the box [m]."""

OBJECTS = {
    "vehicle": ObjectType.VEHICLE,
    "bicycle": ObjectType.CYCLIST,
    "pedestrian": ObjectType.PEDESTRIAN,
    "traffic_cone": ObjectType.TRAFFIC_CONE,
    "barrier": ObjectType.TRAFFIC_BARRIER,
    "czone_sign": ObjectType.TRAFFIC_OBJECT,
    "generic_object": ObjectType.OTHER,
}
STATIC = frozenset({"traffic_cone", "barrier", "czone_sign", "generic_object"})
"""Static categories: nuplan-devkit ignores their velocity, which may be missing."""

LIGHTS = {
    "green": LightState.TRAFFIC_LIGHT_GREEN,
    "yellow": LightState.TRAFFIC_LIGHT_YELLOW,
    "red": LightState.TRAFFIC_LIGHT_RED,
    "unknown": LightState.TRAFFIC_LIGHT_UNKNOWN,
}

LANES = {0: MapFeatureType.LANE_SURFACE_STREET, 1: MapFeatureType.LANE_BIKE_LANE}
"""``MapFeatureType`` by ``lane_type_fid``."""
LINES = {0: MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE, 2: MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE}
"""``MapFeatureType`` by ``boundary_type_fid``; 3 is a boundary without paint or of unknown paint."""

TURNS = {0: "straight", 1: "left", 2: "right", 3: "u_turn"}
INTERSECTIONS = {
    0: "default",
    1: "traffic_light",
    2: "stop_sign",
    3: "lane_branch",
    4: "lane_merge",
    5: "pass_through",
}
STOPS = {0: "pedestrian_crossing", 1: "stop_sign", 2: "traffic_light", 3: "turn_stop", 4: "yield"}
