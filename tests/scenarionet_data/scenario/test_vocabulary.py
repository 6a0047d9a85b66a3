"""Vocabulary: MetaDrive's type strings, stable codes, colour groups."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.parts import MapFeatures
from scenarionet_data.scenario.vocabulary import (
    LIGHT_COLORS,
    LightColor,
    LightState,
    MapFeatureType,
    ObjectType,
    Provenance,
)

# Every type string of MetaDriveType (metadrive/type.py, release 0.4.3) but TRAFFIC_LIGHT's own states.
OBJECTS = """UNSET VEHICLE PEDESTRIAN CYCLIST OTHER TRAFFIC_CONE TRAFFIC_BARRIER TRAFFIC_OBJECT TRAFFIC_LIGHT GROUND
    INVISIBLE_WALL BUILDING""".split()
FEATURES = """LANE_UNKNOWN LANE_SURFACE_STREET LANE_SURFACE_UNSTRUCTURE LANE_FREEWAY LANE_BIKE_LANE UNKNOWN_LINE
    ROAD_LINE_BROKEN_SINGLE_WHITE ROAD_LINE_SOLID_SINGLE_WHITE ROAD_LINE_SOLID_DOUBLE_WHITE
    ROAD_LINE_BROKEN_SINGLE_YELLOW ROAD_LINE_BROKEN_DOUBLE_YELLOW ROAD_LINE_SOLID_SINGLE_YELLOW
    ROAD_LINE_SOLID_DOUBLE_YELLOW ROAD_LINE_PASSING_DOUBLE_YELLOW UNKNOWN ROAD_EDGE_BOUNDARY ROAD_EDGE_MEDIAN
    ROAD_EDGE_SIDEWALK GUARDRAIL CROSSWALK STOP_SIGN SPEED_BUMP DRIVEWAY""".split()
LIGHTS = """LANE_STATE_UNKNOWN LANE_STATE_ARROW_STOP LANE_STATE_ARROW_CAUTION LANE_STATE_ARROW_GO LANE_STATE_STOP
    LANE_STATE_CAUTION LANE_STATE_GO LANE_STATE_FLASHING_STOP LANE_STATE_FLASHING_CAUTION TRAFFIC_LIGHT_GREEN
    TRAFFIC_LIGHT_YELLOW TRAFFIC_LIGHT_RED TRAFFIC_LIGHT_UNKNOWN""".split()
OURS = "STOP_LINE DRIVABLE_AREA INTERSECTION ROADBLOCK CARPARK_AREA TRAFFIC_LIGHT".split()


def test_every_metadrive_string_has_a_code():
    assert [member.name for member in ObjectType] == OBJECTS
    assert [member.name for member in MapFeatureType] == FEATURES + OURS
    assert [member.name for member in LightState] == ["ABSENT", *LIGHTS]
    assert [member.name for member in Provenance] == ["OBSERVED", "INFERRED"]


def test_codes_are_bytes_and_unset_is_zero():
    for words in (ObjectType, MapFeatureType, LightState, Provenance, LightColor):
        assert all(0 <= member < 256 for member in words)
        assert list(words) == sorted(words)
        assert next(iter(words)) == 0


@pytest.mark.parametrize(
    ("color", "states"),
    [
        (LightColor.GREEN, "LANE_STATE_GO LANE_STATE_ARROW_GO TRAFFIC_LIGHT_GREEN"),
        (
            LightColor.YELLOW,
            "LANE_STATE_CAUTION LANE_STATE_ARROW_CAUTION LANE_STATE_FLASHING_CAUTION TRAFFIC_LIGHT_YELLOW",
        ),
        (LightColor.RED, "LANE_STATE_STOP LANE_STATE_ARROW_STOP TRAFFIC_LIGHT_RED"),
        (LightColor.UNKNOWN, "ABSENT LANE_STATE_UNKNOWN LANE_STATE_FLASHING_STOP TRAFFIC_LIGHT_UNKNOWN"),
    ],
)
def test_colors_match_metadrives_groups(color, states):
    """As in MetaDriveType.simplify_light_status, flashing red is unknown."""
    assert {LightState(code).name for code in np.flatnonzero(color == LIGHT_COLORS)} == set(states.split())


def test_color_table_takes_any_shape_and_is_read_only():
    states = np.array([[LightState.LANE_STATE_GO, LightState.ABSENT]], dtype=np.uint8)
    assert LIGHT_COLORS[states].tolist() == [[LightColor.GREEN, LightColor.UNKNOWN]]
    with pytest.raises(ValueError, match="read-only"):
        LIGHT_COLORS[0] = 1


def test_groups_of_map_features():
    codes = np.array(list(MapFeatureType), dtype=np.uint8)
    names = np.array([member.name for member in MapFeatureType])
    assert set(names[vocabulary.is_lane(codes)]) == {n for n in FEATURES if n.startswith("LANE_")}
    lines = {n for n in FEATURES if n.startswith("ROAD_LINE_")} | {"UNKNOWN_LINE"}
    assert set(names[vocabulary.is_road_line(codes)]) == lines
    edges = {n for n in FEATURES if n.startswith("ROAD_EDGE_")} | {"UNKNOWN", "GUARDRAIL"}
    assert set(names[vocabulary.is_road_edge(codes)]) == edges


def test_names_by_code():
    table = vocabulary.names(MapFeatureType)
    assert table[MapFeatureType.CROSSWALK] == "CROSSWALK"
    assert table[5] is None
    assert len(table) == max(MapFeatureType) + 1


def test_old_name_of_the_feature_type_warns():
    features = MapFeatures.empty()
    with pytest.warns(DeprecationWarning, match="feature_type"):
        assert features.types is features.feature_type
