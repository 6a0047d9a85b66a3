"""Enumerations of object types, map feature types, traffic light states and provenance.

Arrays hold the codes (uint8), files and SQL hold the names. Names are MetaDrive's type strings
(``metadrive/type.py``, release 0.4.3) so that an export needs no translation; the last group of map
features is our own, for features of other datasets that MetaDrive ignores.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Object, UInt8


class ObjectType(IntEnum):
    """Types of objects."""

    UNSET = 0
    VEHICLE = 1
    PEDESTRIAN = 2
    CYCLIST = 3
    OTHER = 4
    TRAFFIC_CONE = 5
    TRAFFIC_BARRIER = 6
    TRAFFIC_OBJECT = 7
    TRAFFIC_LIGHT = 8
    GROUND = 9
    INVISIBLE_WALL = 10
    BUILDING = 11


class MapFeatureType(IntEnum):
    """Types of map features."""

    LANE_UNKNOWN = 0
    LANE_SURFACE_STREET = 1
    LANE_SURFACE_UNSTRUCTURE = 2
    LANE_FREEWAY = 3
    LANE_BIKE_LANE = 4

    UNKNOWN_LINE = 16
    ROAD_LINE_BROKEN_SINGLE_WHITE = 17
    ROAD_LINE_SOLID_SINGLE_WHITE = 18
    ROAD_LINE_SOLID_DOUBLE_WHITE = 19
    ROAD_LINE_BROKEN_SINGLE_YELLOW = 20
    ROAD_LINE_BROKEN_DOUBLE_YELLOW = 21
    ROAD_LINE_SOLID_SINGLE_YELLOW = 22
    ROAD_LINE_SOLID_DOUBLE_YELLOW = 23
    ROAD_LINE_PASSING_DOUBLE_YELLOW = 24

    UNKNOWN = 32  # MetaDrive's name for a road edge of unknown kind
    ROAD_EDGE_BOUNDARY = 33
    ROAD_EDGE_MEDIAN = 34
    ROAD_EDGE_SIDEWALK = 35
    GUARDRAIL = 36

    CROSSWALK = 48
    STOP_SIGN = 49
    SPEED_BUMP = 50
    DRIVEWAY = 51

    STOP_LINE = 64
    DRIVABLE_AREA = 65
    INTERSECTION = 66
    ROADBLOCK = 67
    CARPARK_AREA = 68
    TRAFFIC_LIGHT = 69  # its position; its states are in `Lights`


AREAS_TO_DRIVE_ON = (
    MapFeatureType.DRIVABLE_AREA,
    MapFeatureType.INTERSECTION,
    MapFeatureType.ROADBLOCK,
    MapFeatureType.CARPARK_AREA,
    MapFeatureType.DRIVEWAY,
    MapFeatureType.SPEED_BUMP,
)
"""Drivable areas besides lanes."""


class LightState(IntEnum):
    """State of a traffic light for one lane at one timestep; ``ABSENT`` = not reported."""

    ABSENT = 0
    LANE_STATE_UNKNOWN = 1
    LANE_STATE_ARROW_STOP = 2
    LANE_STATE_ARROW_CAUTION = 3
    LANE_STATE_ARROW_GO = 4
    LANE_STATE_STOP = 5
    LANE_STATE_CAUTION = 6
    LANE_STATE_GO = 7
    LANE_STATE_FLASHING_STOP = 8
    LANE_STATE_FLASHING_CAUTION = 9
    TRAFFIC_LIGHT_GREEN = 10
    TRAFFIC_LIGHT_YELLOW = 11
    TRAFFIC_LIGHT_RED = 12
    TRAFFIC_LIGHT_UNKNOWN = 13


class LightColor(IntEnum):
    """Coarse group of a light state."""

    UNKNOWN = 0
    GREEN = 1
    YELLOW = 2
    RED = 3


class Provenance(IntEnum):
    """Origin of a light's states."""

    OBSERVED = 0
    INFERRED = 1


# MetaDrive's grouping (MetaDriveType.simplify_light_status): flashing red counts as unknown.
_GREEN = (LightState.LANE_STATE_GO, LightState.LANE_STATE_ARROW_GO, LightState.TRAFFIC_LIGHT_GREEN)
_YELLOW = (
    LightState.LANE_STATE_CAUTION,
    LightState.LANE_STATE_ARROW_CAUTION,
    LightState.LANE_STATE_FLASHING_CAUTION,
    LightState.TRAFFIC_LIGHT_YELLOW,
)
_RED = (LightState.LANE_STATE_STOP, LightState.LANE_STATE_ARROW_STOP, LightState.TRAFFIC_LIGHT_RED)


def _color_table() -> UInt8:
    table = np.full(len(LightState), LightColor.UNKNOWN, dtype=np.uint8)
    for states, color in ((_GREEN, LightColor.GREEN), (_YELLOW, LightColor.YELLOW), (_RED, LightColor.RED)):
        table[[int(state) for state in states]] = color
    table.flags.writeable = False
    return table


LIGHT_COLORS = _color_table()
"""``LIGHT_COLORS[state]`` is the :class:`LightColor` of a :class:`LightState` code, any array shape."""


def is_lane(feature_type: UInt8) -> Bool:
    """True where a map feature is a lane."""
    return feature_type <= MapFeatureType.LANE_BIKE_LANE


def is_road_line(feature_type: UInt8) -> Bool:
    """True where a map feature is a painted line between lanes."""
    return (feature_type >= MapFeatureType.UNKNOWN_LINE) & (
        feature_type <= MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW
    )


def is_road_edge(feature_type: UInt8) -> Bool:
    """True where a map feature bounds the road (sidewalks and guardrails included)."""
    return (feature_type >= MapFeatureType.UNKNOWN) & (feature_type <= MapFeatureType.GUARDRAIL)


def names(vocabulary: type[IntEnum]) -> Object:
    """Names by code, ``None`` where a code is unused: ``names(ObjectType)[codes]``."""
    table = np.full(max(vocabulary) + 1, None, dtype=object)
    for member in vocabulary:
        table[member] = member.name
    return table
