"""Lyft's semantic map: geographic position, lanes and paint, and the lights that control lanes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.lyft import Lyft
from scenarionet_data.converters.lyft.map_features import FACES, LyftCity, read_city
from scenarionet_data.converters.lyft.wire import local_to_earth, on_ellipsoid
from scenarionet_data.errors import CorruptSource
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import (
    LIGHT_COLORS,
    LightColor,
    LightState,
    MapFeatureType,
    is_lane,
)
from tests.fixtures import lyft as fixture
from tests.fixtures import lyft_world as world
from tests.fixtures.lyft_messages import FACES as FACE_FIELDS
from tests.fixtures.lyft_messages import MapFragment
from tests.fixtures.reading import scenarios


def write(folder: Path, is_backward_stored_along: bool = False) -> LyftCity:
    world.write_map(folder / "semantic_map.pb", is_backward_stored_along)
    world.write_meta(folder / "meta.json")
    return read_city(folder / "semantic_map.pb", folder / "meta.json")


@pytest.fixture
def city(tmp_path: Path) -> LyftCity:
    return write(tmp_path)


@pytest.fixture
def features(city: LyftCity) -> MapFeatures:
    return city.features.build(np.zeros(3), has_z=False)


def row(features: MapFeatures, name: str) -> int:
    (found,) = np.flatnonzero(features.ids == name)
    return int(found)


# --- geographic coordinates -----------------------------------------------------------------------------


def test_known_places() -> None:
    latitude, longitude = np.radians([[0.0, 0.0, 90.0], [0.0, 90.0, 0.0]])
    wanted = [[6378137.0, 0.0, 0.0], [0.0, 6378137.0, 0.0], [0.0, 0.0, 6356752.314245]]
    np.testing.assert_allclose(on_ellipsoid(latitude, longitude), wanted, atol=1e-6)
    up = local_to_earth(np.array([[3.0, 4.0, 5.0]]), np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(up, [[6378142.0, 3.0, 4.0]], atol=1e-8)


@given(st.floats(-89.9, 89.9), st.floats(-180.0, 180.0), st.floats(-100.0, 9000.0))
def test_geographic_coordinates_match_proj(latitude: float, longitude: float, height: float) -> None:
    pyproj = pytest.importorskip("pyproj", reason="needs pyproj")
    geocentric = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    wanted = geocentric.transform(longitude, latitude, height)
    place = np.radians([[latitude], [longitude]])
    np.testing.assert_allclose(local_to_earth(np.array([[0.0, 0.0, height]]), *place)[0], wanted, atol=1e-6)


# --- lanes and paint ------------------------------------------------------------------------------------


def test_lanes_match_the_written_layout(features: MapFeatures) -> None:
    assert set(features.ids[is_lane(features.feature_type)]) == set(world.LANES)
    low, high = world.JUNCTION
    for name, first, last, y in (("in0", world.ENDS[0], low, -1.75), ("back-in", world.ENDS[1], high, 1.75)):
        center = features.polyline[row(features, name)]
        np.testing.assert_allclose(center[[0, -1], 0], [first, last], atol=0.02)
        np.testing.assert_allclose(center[:, 1], y, atol=0.02)
        assert not center[:, 2].any()
        np.testing.assert_allclose(features.width[row(features, name)], world.WIDTH / 2.0, atol=0.02)
        assert np.abs(np.diff(center[:, 0])).max() <= 2.0


def test_backward_lanes_follow_the_driving_direction_in_any_storage_order(tmp_path: Path) -> None:
    (tmp_path / "along").mkdir()
    (tmp_path / "driven").mkdir()
    along, driven = (write(tmp_path / name, name == "along") for name in ("along", "driven"))
    first, second = (found.features.build(np.zeros(3), has_z=False) for found in (along, driven))
    assert list(first.ids) == list(second.ids)
    for name in world.LANES:
        line, other = (found.polyline[row(found, name)] for found in (first, second))
        np.testing.assert_allclose(line, other, atol=0.02)
        np.testing.assert_allclose(first.width[row(first, name)], second.width[row(second, name)], atol=0.02)
    paint = [list(found.left_boundaries[row(found, "back-out")]) for found in (first, second)]
    lines = [found.polyline[row(found, name)] for found, (name,) in zip((first, second), paint, strict=True)]
    np.testing.assert_allclose(lines[0], lines[1], atol=0.02)


def test_lanes_are_linked(features: MapFeatures) -> None:
    def linked(name: str) -> tuple[list[str], list[str]]:
        return list(features.entry_lanes[row(features, name)]), list(features.exit_lanes[row(features, name)])

    assert linked("in0") == ([], ["through0", "left1"])
    assert linked("through0") == (["in0"], ["out0"])
    assert linked("in2") == ([], ["nowhere"])
    assert linked("back-out") == (["back-through"], [])
    assert list(features.left_neighbors[row(features, "in1")]) == ["in0"]
    assert list(features.right_neighbors[row(features, "in1")]) == ["in2"]


def test_lane_properties(features: MapFeatures) -> None:
    def of(name: str) -> tuple[str, float, int, str | None]:
        at = row(features, name)
        limit = features.speed_limit[at]
        return (
            MapFeatureType(features.feature_type[at]).name,
            float(limit),
            features.is_intersection[at],
            features.extras[at],
        )

    assert of("in0") == ("LANE_SURFACE_STREET", world.SPEED, 0, '{"parent":"west"}')
    assert of("in2")[0] == "LANE_BIKE_LANE"
    assert of("out1")[3] == '{"access_restriction":"ONLY_BUS","parent":"east"}'
    assert of("back-out")[1] == world.SPEED_BACK
    assert of("back-in")[1] == world.SPEED  # the segment states one limit for both directions
    assert np.isnan(of("left1")[1])
    assert of("left1")[2:] == (1, '{"parent":"crossing","turn_type":"LEFT"}')


def test_paint_changes_along_a_side(features: MapFeatures) -> None:
    lane = row(features, "out0")
    assert list(features.right_boundaries[lane]) == ["out0-right-0", "out0-right-1"]
    broken, solid = (row(features, name) for name in ("out0-right-0", "out0-right-1"))
    assert features.feature_type[broken] == MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE
    assert features.feature_type[solid] == MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE
    change = world.JUNCTION[1] + 50.0
    np.testing.assert_allclose(features.polyline[broken][[0, -1], 0], [world.JUNCTION[1], change], atol=0.02)
    np.testing.assert_allclose(features.polyline[solid][[0, -1], 0], [change, world.ENDS[1]], atol=0.02)
    assert not len(features.left_boundaries[row(features, "left1")])  # paint not stated
    assert not len(features.right_boundaries[row(features, "left1")])  # no paint
    assert features.feature_type[row(features, "in2-right")] == MapFeatureType.ROAD_EDGE_BOUNDARY
    assert features.feature_type[row(features, "out1-right")] == MapFeatureType.UNKNOWN_LINE


def test_controls_become_features(features: MapFeatures) -> None:
    def of(name: str) -> MapFeatureType:
        return MapFeatureType(features.feature_type[row(features, name)])

    assert of("CROSSWALK") == MapFeatureType.CROSSWALK
    np.testing.assert_allclose(features.polygon[row(features, "CROSSWALK")][:, :2], world.CROSSWALK, atol=0.02)
    assert of("BUMP") == MapFeatureType.SPEED_BUMP
    assert of("PARKING") == MapFeatureType.CARPARK_AREA
    assert of("STOPLINE") == MapFeatureType.STOP_LINE
    assert of("STOP") == MapFeatureType.STOP_SIGN
    assert features.polyline[row(features, "STOP")].shape == (1, 3)
    assert list(features.controlled_lanes[row(features, "STOP")]) == ["in1"]
    assert not {"YIELD", "RED0", "LIGHT0", "west", "crossing", "stub"} & set(features.ids)


# --- lights ---------------------------------------------------------------------------------------------


def test_every_face_shows_its_color() -> None:
    colors = {"red": LightColor.RED, "yellow": LightColor.YELLOW, "green": LightColor.GREEN}
    assert set(FACES) == set(FACE_FIELDS.values())
    for name, number in FACE_FIELDS.items():
        state = FACES[number]
        if name != "signal_flashing_red":  # MetaDrive counts it as unknown
            (color,) = [color for word, color in colors.items() if word in name]
            assert LIGHT_COLORS[state] == color
        assert ("ARROW" in state.name) == ("arrow" in name or "u_turn" in name)


def test_faces_control_lanes(city: LyftCity) -> None:
    assert city.faces["RED0"] == (LightState.LANE_STATE_STOP, ["in0"])
    assert city.faces["GRN1"] == (LightState.LANE_STATE_ARROW_GO, ["in1"])  # through the light it belongs to


def test_states_follow_the_faces(tmp_path: Path) -> None:
    scenario = scenarios(Lyft(), fixture.write_dataset(tmp_path / "lyft"))[0]
    lights = scenario.lights
    keys = list(zip(lights.ids, lights.lane_ids, strict=True))
    assert keys == [("ELSEWHERE", "ELSEWHERE"), ("LIGHT0", "in0"), ("LIGHT1", "in1")]
    assert lights.is_lane_in_map.tolist() == [False, True, True]
    wanted = [LightState.LANE_STATE_STOP] * 15 + [LightState.LANE_STATE_GO] * 15 + [LightState.LANE_STATE_CAUTION] * 15
    for step in (9, 19, 29, 39):
        wanted[step] = LightState.LANE_STATE_UNKNOWN
    assert lights.state[1].tolist() == wanted
    assert set(lights.state[2].tolist()) == {LightState.LANE_STATE_ARROW_GO}
    elsewhere = [LightState.LANE_STATE_UNKNOWN, LightState.ABSENT] * 23
    assert lights.state[0].tolist() == elsewhere[:45]
    assert np.isnan(lights.stop_point[0]).all()
    stop = lights.stop_point[1] + scenario.origin
    np.testing.assert_allclose(stop, [world.JUNCTION[0], -1.75, 0.0], atol=0.02)


def test_most_restrictive_lit_face_wins(tmp_path: Path) -> None:
    tables = fixture.recording(1, 30)
    is_yellow = tables["traffic_light_faces"]["face_id"] == "YEL0"
    tables["traffic_light_faces"]["traffic_light_face_status"][is_yellow] = [1.0, 0.0, 0.0]
    fixture.write_tables(tmp_path / "a.zarr", tables)
    world.write_map(tmp_path / "semantic_map.pb")
    world.write_meta(tmp_path / "meta.json")
    (scenario,) = scenarios(Lyft(), tmp_path)
    (light,) = np.flatnonzero(scenario.lights.ids == "LIGHT0")
    assert scenario.lights.state[light, 0] == LightState.LANE_STATE_STOP
    assert scenario.lights.state[light, 12] == LightState.LANE_STATE_CAUTION


# --- invalid input --------------------------------------------------------------------------------------


def test_map_without_lanes_or_of_damaged_elements_is_refused(tmp_path: Path) -> None:
    nameless, empty = world.semantic_map(), world.semantic_map()
    for element in nameless.elements[: len(nameless.elements) // 4]:
        element.ClearField("id")
    del empty.elements[:]
    for message, reason in ((nameless, "elements damaged"), (empty, "no lanes")):
        with pytest.raises(CorruptSource, match=reason):
            _read(tmp_path, message)


def test_damaged_element_is_left_out(tmp_path: Path) -> None:
    nameless, twice, uneven = (world.semantic_map() for _ in range(3))
    nameless.elements[3].ClearField("id")
    twice.elements[3].id.id = twice.elements[4].id.id
    lane = next(element.element.lane for element in uneven.elements if element.element.HasField("lane"))
    del lane.left_boundary.vertex_deltas_y_cm[3:]
    for message, reason in (
        (nameless, "found an element without an id"),
        (twice, "found one repeated"),
        (uneven, "different numbers of x, y and z"),
    ):
        first = _read(tmp_path, message).features.defects[0]
        assert (first.count, first.action) == (1, "dropped")
        assert reason in first.reason


def _read(folder: Path, message: MapFragment) -> LyftCity:
    (folder / "semantic_map.pb").write_bytes(message.SerializeToString())
    world.write_meta(folder / "meta.json")
    return read_city(folder / "semantic_map.pb", folder / "meta.json")
