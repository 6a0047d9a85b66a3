"""The INTERACTION converter and its Lanelet2 map: conformance, windows and egos, every row, dirt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.building.projection import to_utm, utm_zone
from scenarionet_data.converters.formats.lanelet2 import read_lanelet2
from scenarionet_data.converters.interaction import Interaction
from scenarionet_data.errors import BadParameter, CorruptSource, SourceNotFound
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.testing import ConverterConformance
from tests.fixtures import interaction as fixture
from tests.fixtures.reading import scenarios

CONVERTER = Interaction()


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "vehicle_tracks_*.csv"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_map(folder)
        fixture.write_recording(folder, 1)
        return fixture.write_recording(folder, has_pedestrians=True)

    def test_damaged_files_are_named(self, raw: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
        """A file cut in its rows is a shorter recording; without a usable row it is refused."""
        for content in (b"", bytes(range(251)) * 9, f"{fixture.HEADER}\n1,1,50,car,x,0,0,0,0,4,2\n".encode()):
            copy = fixture.write_recording(tmp_path_factory.mktemp("damaged"))
            next(copy.rglob("vehicle_tracks_000.csv")).write_bytes(content)
            with pytest.raises(CorruptSource, match="download it again"):
                scenarios(CONVERTER, copy, has_map=False)


class TestMaps(TestRecordings):
    damaged_glob = "*.osm"
    options = {"ego": "each", "window": 5.0}  # noqa: RUF012

    def test_damaged_files_are_named(self, raw: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
        ConverterConformance.test_damaged_files_are_named(self, raw, tmp_path_factory)


def recorded_rows(found: list[ScenarioDescription]) -> np.ndarray:
    """Track, milliseconds, x, y of each state of vehicles, sorted."""
    rows = []
    for scenario in found:
        tracks = scenario.tracks
        for track, step in zip(*np.nonzero(tracks.valid), strict=True):
            if tracks.object_type[track] == ObjectType.VEHICLE:
                place = tracks.position[track, step, :2] + scenario.origin[:2]
                time = scenario.extras["start_timestamp_ms"] + round(scenario.timestamps[step] * 1000)
                rows.append((int(tracks.ids[track]), time, *place))
    return np.array(sorted(rows))


def test_every_row_is_in_one_window(tmp_path: Path) -> None:
    fixture.write_recording(tmp_path)
    found = scenarios(CONVERTER, tmp_path, has_map=False, window=5.0)
    raw = fixture.read_numbers(next(tmp_path.rglob("*.csv")))
    np.testing.assert_allclose(recorded_rows(found), raw[np.lexsort(raw.T[1::-1])], atol=1e-4)
    # 255 frames: four windows of 50, and one of 55, for the last 5 are too few for a window of their own.
    assert [scenario.num_timesteps for scenario in found] == [50, 50, 50, 50, 55]


def test_egos(tmp_path: Path) -> None:
    fixture.write_recording(tmp_path)
    assert [each.ego_id for each in scenarios(CONVERTER, tmp_path, has_map=False)] == ["1", "1"]
    each = scenarios(CONVERTER, tmp_path, has_map=False, ego="each", window=30.0)
    assert [(one.ego_id, one.current_timestep) for one in each] == [("1", 10), ("2", 39)]
    assert each[1].id.endswith("DR_TEST_Straight-000-2@100")
    for fewer in ({"every": 2}, {"seen": 7.0}):
        (only,) = scenarios(CONVERTER, tmp_path, has_map=False, ego="each", window=30.0, **fewer)
        assert only.ego_id == "1"
    with pytest.raises(BadParameter, match="every, seen"):
        scenarios(CONVERTER, tmp_path, every=0)


def test_pedestrians_stand_beside_vehicles_of_the_same_id(tmp_path: Path) -> None:
    fixture.write_recording(tmp_path, has_pedestrians=True)
    tracks = scenarios(CONVERTER, tmp_path, has_map=False)[0].tracks
    person = tracks.index("P1")
    assert tracks.object_type[person] == ObjectType.PEDESTRIAN
    assert tracks.is_type_assumed[person] and tracks.is_size_assumed[person]
    assert tracks.heading[person, 0] == pytest.approx(np.pi / 2, abs=1e-3)
    assert not tracks.is_size_assumed[tracks.index("1")]


def test_bad_rows_are_dropped_and_told(tmp_path: Path) -> None:
    path = next(fixture.write_recording(tmp_path).rglob("*.csv"))
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace("2.0,3.0", "nan,3.0")
    lines[5] = lines[5].replace("500,car", "555,car")
    lines[7] = lines[6]
    lines[9] = "1,9,900"
    path.write_text("\n".join(lines))
    (scenario,) = scenarios(CONVERTER, tmp_path, has_map=False, window=30.0)
    dropped = {(defect.field, defect.count, defect.location) for defect in scenario.defects}
    assert ("position", 1, "row 4") in dropped
    assert ("timestamp_ms", 1, "row 6") in dropped
    assert any(field in ("timestep", "row") and count == 1 for field, count, _ in dropped)
    assert (~scenario.tracks.valid[scenario.ego_index, :12]).sum() == 4


def test_map(tmp_path: Path) -> None:
    features = read_lanelet2(fixture.write_map(tmp_path), (0.0, 0.0)).build(np.zeros(3), has_z=False)
    row = {name: index for index, name in enumerate(features.ids)}
    left, right, ahead = row["30"], row["31"], row["32"]
    np.testing.assert_allclose(features.polyline[right][[0, -1], :2], [[0, 2], [100, 2]], atol=0.02)
    np.testing.assert_allclose(features.width[right], 2.0, atol=0.02)  # though way 12 is stored backwards
    assert list(features.exit_lanes[right]) == ["32"] and list(features.entry_lanes[ahead]) == ["31"]
    assert list(features.right_neighbors[left]) == ["31"] and list(features.left_neighbors[right]) == ["30"]
    assert not len(features.exit_lanes[left]) and not len(features.left_neighbors[left])
    assert features.speed_limit[left] == pytest.approx(25 * 0.44704) and np.isnan(features.speed_limit[right])
    assert list(features.left_boundaries[right]) == ["line-11"]
    assert features.feature_type[row["line-11"]] == MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE
    assert list(features.controlled_lanes[row["stop-15"]]) == ["31"]


def test_missing_references_are_told(tmp_path: Path) -> None:
    path = fixture.write_map(tmp_path)
    path.write_text(path.read_text().replace("<node id='3' ", "<node id='33' "))
    builder = read_lanelet2(path, (0.0, 0.0))
    assert {defect.field for defect in builder.defects} == {"nd", "member"}
    assert [defect.count for defect in builder.defects if defect.field == "member"] == [2]


@pytest.mark.parametrize(
    "doctype",
    [
        "<!DOCTYPE osm [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;&a;'>]>",
        "<!DOCTYPE osm [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>",
    ],
)
def test_entities_are_refused(tmp_path: Path, doctype: str) -> None:
    with pytest.raises(CorruptSource, match="document type"):
        read_lanelet2(fixture.write_map(tmp_path, doctype))


def test_a_place_without_map_is_named(tmp_path: Path) -> None:
    fixture.write_recording(tmp_path)
    with pytest.raises(SourceNotFound, match="has_map=false"):
        scenarios(CONVERTER, tmp_path)


def test_utm_equals_pyproj() -> None:
    pyproj = pytest.importorskip("pyproj")
    rng = np.random.default_rng(0)
    for latitude, longitude in ((0.0, 0.0), (50.8, 6.1), (37.9, -122.5), (-33.0, 151.0)):
        zone = utm_zone(longitude)
        north, east = latitude + rng.uniform(-0.2, 0.2, 50), longitude + rng.uniform(-0.2, 0.2, 50)
        expected = pyproj.Transformer.from_crs(4326, 32600 + zone, always_xy=True).transform(east, north)
        np.testing.assert_allclose(to_utm(north, east, zone), np.stack(expected, axis=-1), atol=1e-3)
