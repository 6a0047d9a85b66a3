"""Words of CommonRoad 2020a (CommonRoad/commonroad-io: ``XML_commonRoad_XSD.xsd``), and what they are here."""

from __future__ import annotations

from scenarionet_data.scenario.vocabulary import LightColor, LightState, MapFeatureType, ObjectType

WAITING = (100_000.0, 100_000.0)
"""Where an obstacle stands while it is not seen [m]: the format wants obstacles from the first timestep on."""

SOLUTION = ".solution.xml"
"""Ending of the file beside a scenario in which the ego drives as recorded."""

LANES = {
    MapFeatureType.LANE_UNKNOWN: "unknown",
    MapFeatureType.LANE_SURFACE_STREET: "urban",
    MapFeatureType.LANE_SURFACE_UNSTRUCTURE: "unknown",
    MapFeatureType.LANE_FREEWAY: "highway",
    MapFeatureType.LANE_BIKE_LANE: "bicycleLane",
}
LANE_OF_WORD = {
    **dict.fromkeys(("interstate", "highway", "exitRamp", "accessRamp"), MapFeatureType.LANE_FREEWAY),
    "bicycleLane": MapFeatureType.LANE_BIKE_LANE,
    **dict.fromkeys(("urban", "country", "busLane", "mainCarriageWay", "driveWay", "intersection", "busStop"),
                    MapFeatureType.LANE_SURFACE_STREET),
    "unknown": MapFeatureType.LANE_UNKNOWN,
}  # fmt: skip
"""Of several words the first counts that is in this table; a lanelet with none of them is no lane."""
CROSSWALK = "crosswalk"

MARKS = {
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: "dashed",
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE: "solid",
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: "solid_solid",
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: "dashed",
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: "dashed_dashed",
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW: "solid",
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: "solid_solid",
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: "solid_dashed",
    MapFeatureType.ROAD_EDGE_BOUNDARY: "curb",
    MapFeatureType.ROAD_EDGE_MEDIAN: "curb",
    MapFeatureType.ROAD_EDGE_SIDEWALK: "curb",
    MapFeatureType.GUARDRAIL: "curb",
    MapFeatureType.UNKNOWN: "curb",
    MapFeatureType.UNKNOWN_LINE: "unknown",
}
MARK_OF_WORD = {
    "dashed": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "broad_dashed": MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "solid": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "broad_solid": MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    "solid_solid": MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE,
    "dashed_dashed": MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW,
    "solid_dashed": MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    "dashed_solid": MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    "curb": MapFeatureType.ROAD_EDGE_BOUNDARY,
    "lowered_curb": MapFeatureType.ROAD_EDGE_BOUNDARY,
    "unknown": MapFeatureType.UNKNOWN_LINE,
}

MOVING = {ObjectType.VEHICLE: "car", ObjectType.PEDESTRIAN: "pedestrian", ObjectType.CYCLIST: "bicycle"}
STANDING = {ObjectType.TRAFFIC_CONE: "constructionZone", ObjectType.TRAFFIC_BARRIER: "roadBoundary"}
"""Words of static obstacles; other objects are ``unknown``."""
OBJECT_OF_WORD = {
    **dict.fromkeys(("car", "truck", "bus", "motorcycle", "priorityVehicle", "train", "taxi", "parkedVehicle"),
                    ObjectType.VEHICLE),
    "pedestrian": ObjectType.PEDESTRIAN,
    "bicycle": ObjectType.CYCLIST,
    "constructionZone": ObjectType.TRAFFIC_CONE,
    "roadBoundary": ObjectType.TRAFFIC_BARRIER,
    "unknown": ObjectType.OTHER,
}  # fmt: skip

COLORS = {LightColor.UNKNOWN: "inactive", LightColor.GREEN: "green", LightColor.YELLOW: "yellow", LightColor.RED: "red"}
STATE_OF_COLOR = {
    "inactive": LightState.LANE_STATE_UNKNOWN,
    "green": LightState.LANE_STATE_GO,
    "yellow": LightState.LANE_STATE_CAUTION,
    "redYellow": LightState.LANE_STATE_CAUTION,
    "red": LightState.LANE_STATE_STOP,
}

STOP, SPEED = "206", "274"
"""Traffic signs of Germany, which hold in CommonRoad's country of no name, ZAM."""
