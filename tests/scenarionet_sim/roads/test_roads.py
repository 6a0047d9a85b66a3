"""Roads: segments, lanes, polygons and their grids, against shapely and against plain loops."""

from __future__ import annotations

import pickle
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data import converters
from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane, is_road_edge, is_road_line
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.roads.roads import Roads
from tests.fixtures.scenarios import make_scenario

LANE = MapFeatureType.LANE_SURFACE_STREET
EDGE = MapFeatureType.ROAD_EDGE_BOUNDARY


@pytest.fixture(scope="module")
def generated():
    converter = converters.get("pg")
    (shard,) = converter.shards("3:4", "train", converter.release, converter.Options())
    return converter.scenario(shard, 3)


def roads_of(*features):
    builder = MapBuilder()
    for number, (kind, arguments) in enumerate(features):
        builder.add(f"f{number}", kind, **arguments)
    return Roads.from_map(builder.build(np.zeros(3)))


def test_segments_match_the_lines_of_the_map(generated):
    roads, features = Roads.from_map(generated.map), generated.map
    wanted = []
    for row, line in enumerate(features.polyline):
        if is_road_line(features.feature_type[row]) or is_road_edge(features.feature_type[row]):
            wanted += [(*start[:2], *end[:2], row) for start, end in pairwise(line)]
    found = np.column_stack([roads.segments, roads.segment_feature])
    np.testing.assert_array_equal(found, np.array(wanted))
    np.testing.assert_array_equal(roads.segment_type, features.feature_type[roads.segment_feature])
    assert roads.segments.dtype == np.float32
    assert roads.segment_feature.dtype == np.int32


def test_lanes_and_their_successors(generated):
    roads, features = Roads.from_map(generated.map), generated.map
    rows = np.flatnonzero(is_lane(features.feature_type))
    assert list(roads.lane_ids) == list(features.ids[rows])
    for lane, row in enumerate(rows):
        assert [roads.lane_ids[i] for i in roads.successors[lane]] == list(features.exit_lanes[row])
        np.testing.assert_array_equal(roads.lanes[lane], features.polyline[row][:, :2])


def test_edge_given_as_an_area_becomes_its_outline():
    square = [[0, 0], [4, 0], [4, 4], [0, 4]]
    roads = roads_of((EDGE, {"polygon": square}))
    np.testing.assert_array_equal(roads.segments, [[0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]])


def test_is_on_road_matches_shapely(generated):
    roads = Roads.from_map(generated.map)
    areas = [shapely.Polygon(outline) for outline in roads.polygons]
    rng = np.random.default_rng(0)
    lower, upper = roads.polygons.values.min(axis=0) - 15, roads.polygons.values.max(axis=0) + 15
    points = rng.uniform(lower, upper, (3000, 2))
    shapely_points = shapely.points(points)
    wanted = np.any([shapely.contains(area, shapely_points) for area in areas], axis=0)
    assert 0.02 < wanted.mean() < 0.98
    np.testing.assert_array_equal(roads.is_on_road(points), wanted)
    lanes = roads.lane_at(points)
    first = [next((i for i in range(roads.num_lanes) if areas[i].contains(point)), -1) for point in shapely_points]
    np.testing.assert_array_equal(lanes, first)


def test_lane_without_outline_is_its_buffered_centreline():
    angle = np.linspace(0, 1.5, 60)
    bend = np.stack([30 * np.sin(angle), 30 - 30 * np.cos(angle)], axis=1)
    roads = roads_of((LANE, {"polyline": bend}), (LANE, {"polyline": bend + 100, "width": [1.0, 2.5]}))
    plain, wide = (shapely.Polygon(outline) for outline in roads.polygons)
    wanted = shapely.buffer(shapely.LineString(bend), 1.75, cap_style="flat", join_style="mitre")
    assert plain.is_valid
    assert shapely.hausdorff_distance(plain, wanted) < 0.02
    assert wide.area == pytest.approx(3.5 * shapely.LineString(bend).length, rel=0.05)
    assert roads.lane_at([99.0, 98.0]).item() == -1
    to_the_left = bend[30] + 100 + 0.9 * np.array([-np.sin(angle[30]), np.cos(angle[30])])
    assert roads.lane_at(to_the_left) == 1


def test_implausible_widths_are_ignored():
    """Sources give 0, or the width of the whole street, for lanes without boundaries of their own."""
    line = [[0, 0], [10, 0], [20, 0]]
    roads = roads_of((LANE, {"polyline": line, "width": [[0.0, 1.0], [20.0, 1.0], [2.0, 1.0]]}))
    np.testing.assert_allclose(roads.polygons[0], [[0, -1], [10, -1], [20, -1], [20, 2], [10, 1.75], [0, 1.75]])


def test_sharp_corner_keeps_the_width():
    roads = roads_of((LANE, {"polyline": [[0, 0], [20, 0], [20, 20]]}))
    wanted = shapely.buffer(shapely.LineString([[0, 0], [20, 0], [20, 20]]), 1.75, cap_style="flat", join_style="mitre")
    assert shapely.Polygon(roads.polygons[0]).symmetric_difference(wanted).area < 1e-3


def test_lane_of_repeated_points_has_an_outline():
    roads = roads_of((LANE, {"polyline": [[0, 0], [0, 0], [5, 0], [5, 0], [10, 0], [10, 0]]}))
    assert np.isfinite(roads.polygons.values).all()
    assert roads.is_on_road([[5, 1.7], [5, -1.7], [5, 1.8], [-0.1, 0]]).tolist() == [True, True, False, False]


def test_crosswalks_are_polygons_but_not_drivable():
    roads = roads_of((MapFeatureType.CROSSWALK, {"polygon": [[0, 0], [4, 0], [4, 4], [0, 4]]}))
    assert roads.polygon_type.tolist() == [MapFeatureType.CROSSWALK]
    assert not roads.is_on_road([2.0, 2.0])


@pytest.mark.parametrize("features", [None, make_scenario(0, num_lanes=0).map])
def test_map_without_lanes(features):
    roads = Roads.from_map(features)
    assert roads.num_lanes == 0
    assert not roads.is_on_road(np.zeros((3, 2))).any()
    assert roads.lane_at([0.0, 0.0]) == -1


def test_distant_feature_enlarges_cells_instead_of_adding_many():
    roads = roads_of((EDGE, {"polyline": [[0, 0], [10, 0]]}), (EDGE, {"polyline": [[1e6, 1e6], [1e6 + 10, 1e6]]}))
    assert len(roads.segment_grid.cell_types) <= 1 << 18
    assert len(roads.segment_grid.cell_items) == 2


@given(st.integers(0, 10_000), st.integers(0, 60))
def test_box_is_listed_in_every_cell_it_touches(seed, count):
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-80, 80, (count, 2)).astype(np.float32)
    upper = lower + rng.uniform(0, 40, (count, 2)).astype(np.float32)
    lower[:1], upper[:1] = np.nan, np.nan
    grid = Grid.over(lower, upper)
    origin, size, (columns, rows) = grid.frame[:2], grid.frame[2], grid.frame[3:].astype(int)
    assert len(grid.cell_start) == columns * rows + 1
    for row in range(rows):
        for column in range(columns):
            corner = origin + size * np.array([column, row])
            touches = ((lower < corner + size) & (upper >= corner)).all(axis=1)
            cell = row * columns + column
            listed = grid.cell_items[grid.cell_start[cell] : grid.cell_start[cell + 1]]
            np.testing.assert_array_equal(listed, np.flatnonzero(touches))


@pytest.mark.parametrize(
    ("dataset", "folder"),
    [
        ("waymo", "waymo/training"),
        ("scenarionet", "scenarionet/nuscenes_0"),
        ("argoverse2", "argoverse2/motion-forecasting/val"),
    ],
)
def test_recorded_egos_drive_on_roads(recordings, dataset, folder):
    """Lanes without outlines are buffered (Waymo), widths may be wrong (pickles)."""
    converter = converters.get(dataset)
    for shard in converter.shards(str(recordings / folder), "val", converter.release, converter.Options()):
        for record in converter.records(shard):
            scenario = converter.scenario(shard, record)
            roads, ego = Roads.from_map(scenario.map), scenario.ego_index
            driven = scenario.tracks.position[ego, scenario.tracks.valid[ego], :2]
            assert roads.is_on_road(driven).mean() > 0.95
            areas = np.array([shapely.Polygon(outline).area for outline in roads.polygons if len(outline) > 2])
            assert np.isfinite(areas).all()
            lengths = [shapely.LineString(lane).length if len(lane) > 1 else 0.0 for lane in roads.lanes]
            assert areas[: roads.num_lanes].sum() < 12.0 * sum(lengths)


def test_a_map_is_converted_once_as_long_as_its_content_is_the_same():
    def lane(end):
        return roads_of((MapFeatureType.LANE_SURFACE_STREET, {"polyline": [[0, 0], [end, 0]]}))

    assert lane(10.0) is lane(10.0)
    assert lane(10.5) is not lane(10.0)
    assert lane(10.5).lanes.values[-1].tolist() == [10.5, 0.0]


def test_what_is_made_of_a_map_is_made_once():
    roads, made = roads_of((MapFeatureType.LANE_SURFACE_STREET, {"polyline": [[0, 0], [7, 0]]})), []

    def count(found):
        made.append(found)
        return len(made)

    assert [roads.once(count), roads.once(count)] == [1, 1] and made == [roads]
    assert pickle.loads(pickle.dumps(roads)).once(count) == 2, "what was made stays in this process"


def test_points_in_long_outlines_with_many_turns():
    """Outlines of a thousand points, of which blocks of edges are left out, next to each other in memory."""
    rng, features, shapes = np.random.default_rng(0), [], []
    for number in range(3):
        angle = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
        radius = 10.0 + np.cumsum(rng.normal(0, 0.15, 1000)).clip(-8, 8)
        outline = np.column_stack((30.0 * number + radius * np.cos(angle), radius * np.sin(angle))).astype(np.float32)
        features.append((MapFeatureType.LANE_SURFACE_STREET, {"polygon": outline}))
        shapes.append(shapely.Polygon(outline))
    points = rng.uniform([-20, -20], [80, 20], (5000, 2))
    wanted = np.any([shapely.contains_xy(shape.buffer(0), *points.T) for shape in shapes], axis=0)
    assert 0.1 < wanted.mean() < 0.5
    assert (roads_of(*features).is_on_road(points) == wanted).mean() > 0.999, "but for outlines that cross themselves"
