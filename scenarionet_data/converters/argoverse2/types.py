"""Vocabulary of Argoverse 2 mapped to the lake's: object types, assumed sizes, lanes, painted lines.

Names from av2's code (``av2/datasets/motion_forecasting/data_schema.py``,
``av2/datasets/sensor/constants.py``, ``av2/map/lane_segment.py``).
"""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

EGO = "AV"
EGO_SIZE = (4.877, 2.0, 1.473)
"""Length, width, height [m] of the recording vehicle, a Ford Fusion: the size of the EGO_VEHICLE boxes in
Argoverse 2's scenario-mining annotations."""
EGO_CENTER = (1.34, 0.0, 0.40)
"""Box centre [m] in the ego frame, whose origin is the rear axle: x from the car's overhangs; z is half
the height less 0.333 m, the height of the axle above the map's ground (median over a sensor log)."""


class TypeMapping(NamedTuple):
    """Mapping of an object type of the motion forecasting dataset.

    Attributes:
        type: The lake's type.
        size: Assumed length, width, height [m], as the dataset has no sizes.
        is_assumed: Whether ``type`` is a guess.
    """

    type: ObjectType
    size: tuple[float, float, float]
    is_assumed: bool = False


# Construction objects are cones, barrels, barriers and signs; most are cones. Static, background and unknown
# objects and riderless bicycles have no type among road users and barriers.
OBJECTS = {
    "vehicle": TypeMapping(ObjectType.VEHICLE, (4.0, 2.0, 1.6)),
    "bus": TypeMapping(ObjectType.VEHICLE, (12.0, 2.5, 3.2)),
    "pedestrian": TypeMapping(ObjectType.PEDESTRIAN, (0.5, 0.5, 1.75)),
    "cyclist": TypeMapping(ObjectType.CYCLIST, (2.0, 0.7, 1.75)),
    "motorcyclist": TypeMapping(ObjectType.CYCLIST, (2.0, 0.7, 1.6)),
    "riderless_bicycle": TypeMapping(ObjectType.OTHER, (2.0, 0.7, 1.1)),
    "construction": TypeMapping(ObjectType.TRAFFIC_CONE, (0.5, 0.5, 0.8), is_assumed=True),
    "static": TypeMapping(ObjectType.OTHER, (0.5, 0.5, 1.0)),
    "background": TypeMapping(ObjectType.OTHER, (0.5, 0.5, 1.0)),
    "unknown": TypeMapping(ObjectType.OTHER, (0.5, 0.5, 1.0)),
}
UNKNOWN_OBJECT = TypeMapping(ObjectType.OTHER, (0.5, 0.5, 1.0), is_assumed=True)
"""Mapping of unknown types."""

TRACK_CATEGORIES = dict(enumerate(("FRAGMENT", "UNSCORED", "SCORED", "FOCAL")))

# Rider and bicycle are annotated separately: the rider is the cyclist, the bicycle is OTHER.
_SENSOR_GROUPS = {
    ObjectType.VEHICLE: """REGULAR_VEHICLE LARGE_VEHICLE BOX_TRUCK TRUCK TRUCK_CAB BUS SCHOOL_BUS ARTICULATED_BUS
        RAILED_VEHICLE VEHICULAR_TRAILER""",
    ObjectType.PEDESTRIAN: "PEDESTRIAN OFFICIAL_SIGNALER WHEELCHAIR",
    ObjectType.CYCLIST: "BICYCLIST MOTORCYCLIST WHEELED_RIDER",
    ObjectType.TRAFFIC_CONE: "CONSTRUCTION_CONE CONSTRUCTION_BARREL",
    ObjectType.TRAFFIC_OBJECT: """BOLLARD SIGN STOP_SIGN MOBILE_PEDESTRIAN_CROSSING_SIGN MESSAGE_BOARD_TRAILER
        TRAFFIC_LIGHT_TRAILER""",
    ObjectType.OTHER: "BICYCLE MOTORCYCLE WHEELED_DEVICE STROLLER ANIMAL DOG",
}
SENSOR_CATEGORIES = {word: kind for kind, words in _SENSOR_GROUPS.items() for word in words.split()}
"""The 30 categories of the sensor dataset."""

LANES = {
    "VEHICLE": MapFeatureType.LANE_SURFACE_STREET,
    "BUS": MapFeatureType.LANE_SURFACE_STREET,
    "BIKE": MapFeatureType.LANE_BIKE_LANE,
}

NO_MARK = "NONE"
"""Marks of an unpainted side: neither a line nor an edge, but part of the lane's polygon and width."""

# SOLID_DASH is solid on the lane's side, DASH_SOLID dashed (av2/rendering/map.py). In yellow both are passing lines;
# in white, without such a type, the line has the type of the lane's own side.
MARKS = {
    "DASHED_WHITE": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "DASHED_YELLOW": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW,
    "SOLID_WHITE": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "SOLID_YELLOW": MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW,
    "DOUBLE_SOLID_WHITE": MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE,
    "DOUBLE_SOLID_YELLOW": MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    "DOUBLE_DASH_WHITE": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "DOUBLE_DASH_YELLOW": MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW,
    "DASH_SOLID_YELLOW": MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    "SOLID_DASH_YELLOW": MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    "DASH_SOLID_WHITE": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "SOLID_DASH_WHITE": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "SOLID_BLUE": MapFeatureType.UNKNOWN_LINE,
    "UNKNOWN": MapFeatureType.UNKNOWN_LINE,
}
INEXACT_MARKS = {"DOUBLE_DASH_WHITE", "DASH_SOLID_YELLOW", "SOLID_DASH_YELLOW", "DASH_SOLID_WHITE", "SOLID_DASH_WHITE"}
INEXACT_MARKS |= {"SOLID_BLUE", "UNKNOWN"}
"""Marks with a less specific feature type: their line keeps the name in extras ``mark_type``."""
