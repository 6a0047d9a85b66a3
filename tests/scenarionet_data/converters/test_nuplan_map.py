"""nuPlan's maps: every layer, the lane graph, the projection, and a comparison with GDAL."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import shapely

from scenarionet_data.converters.nuplan import NuPlan, NuPlanOptions
from scenarionet_data.converters.nuplan.map_features import NuPlanCity, read_city
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane
from tests.fixtures import geopackage
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_city as world
from tests.fixtures import nuplan_drive as drives

CONNECTORS = list(range(64001, 64012))  # for two intersections, whose other connectors get ids of their own
ORIGIN = np.array([664_550.0, 3_999_000.0, 0.0])


@pytest.fixture(scope="module")
def built() -> world.City:
    return world.City(drives.invented(seconds=6.0), CONNECTORS)


@pytest.fixture(scope="module")
def path(built: world.City, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fixture.write_maps(tmp_path_factory.mktemp("nuplan"), built)


@pytest.fixture(scope="module")
def city(path: Path) -> NuPlanCity:
    return read_city(path, path.parent)


@pytest.fixture(scope="module")
def features(city: NuPlanCity) -> MapFeatures:
    return city.features.build(ORIGIN, has_z=False)


def row_of(features: MapFeatures, feature_id: Any) -> int:
    (rows,) = np.nonzero(features.ids == str(feature_id))
    return int(rows[0])


def extras_of(features: MapFeatures, feature_id: Any) -> dict[str, Any]:
    text = features.extras[row_of(features, feature_id)]
    return json.loads(text) if text else {}


def source_row(built: world.City, layer: str, fid: int) -> dict[str, Any]:
    return next(row for row in built.rows[layer] if row["fid"] == fid)


# --- layers ---------------------------------------------------------------------------------------------


def test_every_layer_has_its_features(features: MapFeatures, built: world.City) -> None:
    names, counts = np.unique([MapFeatureType(code).name for code in features.feature_type], return_counts=True)
    layers = {name: len(rows) for name, rows in built.rows.items()}
    connectors = layers["lane_connectors"]
    assert dict(zip(names.tolist(), counts.tolist(), strict=True)) == {
        "LANE_SURFACE_STREET": 3 * 3,
        "LANE_BIKE_LANE": 3,
        "LANE_SURFACE_UNSTRUCTURE": connectors,
        "ROAD_LINE_BROKEN_SINGLE_WHITE": 3 * 2,
        "ROAD_LINE_SOLID_SINGLE_WHITE": 3 * 2,
        "UNKNOWN_LINE": 3 + 2 * connectors,
        "ROADBLOCK": layers["lane_groups_polygons"] + layers["lane_group_connectors"],
        "STOP_LINE": layers["stop_polygons"],
        "CROSSWALK": layers["crosswalks"],
        "INTERSECTION": layers["intersections"],
        "DRIVABLE_AREA": layers["road_segments"] + layers["generic_drivable_areas"],
        "CARPARK_AREA": layers["carpark_areas"],
        "ROAD_EDGE_SIDEWALK": layers["walkways"],
    }
    assert len(set(features.ids)) == len(features)


def test_lanes_combine_all_layers(features: MapFeatures, built: world.City) -> None:
    lane = source_row(built, "lanes_polygons", built.lane(1, 1))
    row = row_of(features, lane["fid"])
    (path,) = (path for path in built.rows["baseline_paths"] if path.get("lane_fid") == lane["fid"])
    np.testing.assert_allclose(features.polyline[row][:, :2] + ORIGIN[:2], path["geom"], atol=1e-4)
    np.testing.assert_allclose(features.polygon[row][:, :2] + ORIGIN[:2], lane["geom"][:-1], atol=1e-4)
    assert features.speed_limit[row] == np.float32(world.SPEED_LIMIT)
    np.testing.assert_allclose(features.width[row], [[1.75, 1.75]], atol=0.02)
    assert features.left_boundaries[row].tolist() == [f"boundary-{lane['left_boundary_fid']}"]
    assert features.right_boundaries[row].tolist() == [f"boundary-{lane['right_boundary_fid']}"]
    assert features.is_intersection[row] == 0
    assert extras_of(features, lane["fid"]) == {"roadblock_id": "47001", "lane_index": 1}
    assert np.isnan(features.speed_limit[row_of(features, built.lane(1, 3))])


def test_neighbours_are_listed_from_the_left(features: MapFeatures, built: world.City) -> None:
    left = [features.left_neighbors[row_of(features, built.lane(1, k))].tolist() for k in range(4)]
    right = [features.right_neighbors[row_of(features, built.lane(1, k))].tolist() for k in range(4)]
    lanes = [str(built.lane(1, k)) for k in range(4)]
    assert left == [[], [lanes[0]], [lanes[1]], [lanes[2]]]
    assert right == [[lanes[1]], [lanes[2]], [lanes[3]], []]
    # the geometry agrees: the left neighbour is on the left of the driving direction
    here, beside = (features.polyline[row_of(features, lane)] for lane in (lanes[1], lanes[0]))
    ahead, across = here[1] - here[0], beside[0] - here[0]
    assert ahead[0] * across[1] - ahead[1] * across[0] > 0


def test_connectors_link_lanes(features: MapFeatures, built: world.City) -> None:
    """The source's exit lane of a connector is the lane it starts from."""
    incoming, outgoing = world.PAIRS[1]
    row = row_of(features, CONNECTORS[1])
    assert features.entry_lanes[row].tolist() == [str(built.lane(0, incoming))]
    assert features.exit_lanes[row].tolist() == [str(built.lane(1, outgoing))]
    assert features.is_intersection[row] == 1
    assert len(features.polygon[row]) > 3
    assert extras_of(features, CONNECTORS[1]) == {"roadblock_id": "58000", "turn": "right"}
    assert extras_of(features, CONNECTORS[2])["turn"] == "left"
    lanes = np.flatnonzero(is_lane(features.feature_type))
    by_id = {features.ids[row]: row for row in lanes}
    ends = [
        features.polyline[row][-1] - features.polyline[by_id[after]][0]
        for row in lanes
        for after in features.exit_lanes[row]
    ]
    assert len(ends) == 2 * len(built.rows["lane_connectors"])
    assert np.abs(ends).max() < 0.01
    first = row_of(features, built.lane(0, 1))
    assert features.entry_lanes[first].tolist() == []
    assert features.exit_lanes[first].tolist() == [str(CONNECTORS[k]) for k in (2, 3, 4)]


def test_stops_control_lanes_and_connectors(features: MapFeatures, built: world.City) -> None:
    stop = built.rows["stop_polygons"][0]
    row = row_of(features, f"stop-{stop['fid']}")
    lanes = [str(built.lane(0, k)) for k in range(3)]
    # four connectors are listed in the stop's own row; three more refer to it in theirs
    assert features.controlled_lanes[row].tolist() == [*lanes, *map(str, CONNECTORS[:7])]
    assert extras_of(features, f"stop-{stop['fid']}") == {"stop_type": "traffic_light"}
    sign = built.rows["stop_polygons"][1]
    assert extras_of(features, f"stop-{sign['fid']}") == {"stop_type": "stop_sign"}
    assert features.controlled_lanes[row_of(features, f"stop-{sign['fid']}")].tolist() == []
    crossing = built.rows["crosswalks"][0]
    found = features.controlled_lanes[row_of(features, f"crosswalk-{crossing['fid']}")]
    assert found.tolist() == [str(built.lane(0, k)) for k in range(4)]


def test_area_properties(features: MapFeatures, built: world.City) -> None:
    crossing = built.rows["intersections"][0]["fid"]
    assert extras_of(features, f"intersection-{crossing}") == {"intersection_type": "traffic_light"}
    assert extras_of(features, "roadblock-58001")["intersection_id"] == str(built.rows["intersections"][1]["fid"])
    # The connectors and lanes of the road are inside the drivable area.
    kinds = (MapFeatureType.DRIVABLE_AREA, MapFeatureType.INTERSECTION, MapFeatureType.CARPARK_AREA)
    rows = np.flatnonzero(np.isin(features.feature_type, kinds))
    area = shapely.union_all([shapely.Polygon(features.polygon[row][:, :2]) for row in rows]).buffer(0.05)
    lanes = np.flatnonzero(is_lane(features.feature_type))
    assert all(area.contains(shapely.LineString(features.polyline[row][:, :2])) for row in lanes)


def test_holes_are_counted(built: world.City, tmp_path: Path) -> None:
    ring = built.rows["generic_drivable_areas"][0]["geom"]
    hole = ring.mean(axis=0) + 0.1 * (ring - ring.mean(axis=0))
    path = fixture.write_maps(tmp_path, built)
    geometry = shapely.Polygon(to_degrees(ring), [to_degrees(hole)])
    geopackage.set_geometry(path, "generic_drivable_areas", geometry)
    features = read_city(path, path.parent).features.build(ORIGIN, has_z=False)
    fid = built.rows["generic_drivable_areas"][0]["fid"]
    assert extras_of(features, f"drivable-{fid}") == {"num_holes": 1}
    assert len(features.polygon[row_of(features, f"drivable-{fid}")]) == len(ring) - 1


def test_changed_map_file_is_read_again(built: world.City, tmp_path: Path) -> None:
    path = fixture.write_maps(tmp_path, built)
    assert read_city(path, path.parent) is read_city(path, path.parent)
    first = read_city(path, path.parent)
    other = world.City(drives.invented(seconds=4.0), CONNECTORS)
    path.unlink()
    world.write_map(path, other)
    assert len(read_city(path, path.parent).features) == len(first.features)
    assert not np.array_equal(read_city(path, path.parent).bounds, first.bounds)


# --- projection -----------------------------------------------------------------------------------------


def to_degrees(points: np.ndarray) -> np.ndarray:
    transformer = pyproj.Transformer.from_crs(drives.EPSG, 4326, always_xy=True)
    return np.stack(transformer.transform(*points.T), axis=-1)


def utm(degrees: np.ndarray, zone: int) -> np.ndarray:
    """(n, 2) UTM coordinates of longitude and latitude: Krueger's series to the fourth order in n (0.1 um).

    C. F. F. Karney, Transverse Mercator with an accuracy of a few nanometers, 2011, equations 7 to 11 and 35.
    """
    radius, flattening = 6_378_137.0, 1.0 / 298.257223563
    longitude, latitude = np.radians(degrees).T
    n = flattening / (2.0 - flattening)
    eccentricity = np.sqrt(flattening * (2.0 - flattening))
    east = longitude - np.radians(zone * 6 - 183)
    sine = np.sin(latitude)
    t = np.sinh(np.arctanh(sine) - eccentricity * np.arctanh(eccentricity * sine))
    xi, eta = np.arctan2(t, np.cos(east)), np.arcsinh(np.sin(east) / np.hypot(t, np.cos(east)))
    series = (
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440,
        61 * n**3 / 240 - 103 * n**4 / 140,
        49561 * n**4 / 161280,
    )
    x, y = eta.copy(), xi.copy()
    for order, factor in enumerate(series, start=1):
        x += factor * np.cos(2 * order * xi) * np.sinh(2 * order * eta)
        y += factor * np.sin(2 * order * xi) * np.cosh(2 * order * eta)
    scale = 0.9996 * radius / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    return np.stack([500_000.0 + scale * x, scale * y], axis=-1)


def test_projection_is_utm(path: Path, city: NuPlanCity, features: MapFeatures, built: world.City) -> None:
    """The file's degrees, projected by the textbook series, match the lake's coordinates to 0.1 mm."""
    assert city.projection == "epsg:32611"
    for row in built.rows["baseline_paths"]:
        degrees = geopackage.geometry(path, "baseline_paths", row["fid"])
        lane = row.get("lane_fid") or row.get("lane_connector_fid")
        found = features.polyline[row_of(features, lane)][:, :2].astype(float) + ORIGIN[:2]
        assert np.abs(utm(shapely.get_coordinates(degrees), 11) - found).max() < 1e-4
        steps = [np.diff(points, axis=0) for points in (found, row["geom"])]
        heading, wanted = (np.arctan2(step[:, 1], step[:, 0]) for step in steps)
        assert np.abs(heading - wanted).max() < 1e-4  # between points 2 m apart that are exact to 0.1 mm


def test_ego_drives_on_its_lane(path: Path, tmp_path: Path) -> None:
    """Logs and maps are aligned: the road was built around the ego's path, so the ego drives on lane centrelines."""
    drive = drives.invented(seconds=6.0)
    raw = fixture.write_raw(tmp_path / "raw", [drive])
    (shard,) = NuPlan().shards(str(raw), "mini", "v1.1", NuPlanOptions())
    scenario = NuPlan().scenario(shard, next(iter(NuPlan().records(shard))))
    assert scenario.map is not None
    lanes = np.flatnonzero(is_lane(scenario.map.feature_type))
    lines = shapely.MultiLineString([scenario.map.polyline[row][:, :2].astype(float) for row in lanes])
    ego = scenario.tracks.position[scenario.ego_index, :, :2].astype(float)
    assert shapely.distance(shapely.points(ego), lines).max() < 0.02


# --- comparison with GDAL -------------------------------------------------------------------------------


def test_gdal_reads_equal_geometry(path: Path, city: NuPlanCity, features: MapFeatures) -> None:
    """GDAL finds every layer of the written GeoPackage valid and reads the same coordinates."""
    pyogrio = pytest.importorskip("pyogrio", reason="the cross-check with GDAL needs pyogrio")
    kinds = {
        "lanes_polygons": "{}",
        "boundaries": "boundary-{}",
        "lane_groups_polygons": "roadblock-{}",
        "lane_group_connectors": "roadblock-{}",
        "intersections": "intersection-{}",
        "stop_polygons": "stop-{}",
        "crosswalks": "crosswalk-{}",
        "road_segments": "segment-{}",
        "generic_drivable_areas": "drivable-{}",
        "carpark_areas": "carpark-{}",
        "walkways": "walkway-{}",
    }
    layers = dict(pyogrio.list_layers(path).tolist())
    assert set(kinds) < set(layers)
    meta = dict(zip(*pyogrio.raw.read(path, layer="meta")[3], strict=True))
    transformer = pyproj.Transformer.from_crs(4326, meta["projectedCoordSystem"], always_xy=True)
    for layer, name in kinds.items():
        assert pyogrio.read_info(path, layer=layer)["crs"] == "EPSG:4326"
        _, fids, blobs, _ = pyogrio.raw.read(path, layer=layer, return_fids=True)
        assert len(fids)
        for fid, shape in zip(fids.tolist(), shapely.from_wkb(blobs), strict=True):
            row = row_of(features, name.format(fid))
            found = features.polyline[row] if shape.geom_type == "LineString" else features.polygon[row]
            wanted = np.stack(transformer.transform(*shapely.get_coordinates(shape).T), axis=-1)
            np.testing.assert_allclose(found[:, :2] + ORIGIN[:2], wanted[: len(found)], atol=1e-4)
            assert len(wanted) - len(found) == (shape.geom_type == "Polygon")
