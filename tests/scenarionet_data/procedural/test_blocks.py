"""Blocks that are drawn on demand: their lanes by hand, and traffic that passes them without contacts."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import shapely.affinity

from scenarionet_data.procedural.generate import generate
from scenarionet_data.procedural.graph import CROSS, make_graph
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.plazas import TOLL_ROOM
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from tests.scenarionet_data.procedural.test_flow import check_motion, scenario
from tests.scenarionet_data.procedural.test_maps import LANES, draw

WIDTH = 3.5


def block_of(sequence, seed, fewest, most, **options):
    road_map = draw(seed, sequence=sequence, min_lanes=fewest, max_lanes=most, **options)
    return road_map, road_map.blocks[-1]


def ends(block, *tags):
    """Distances of lanes' first and last points from the middle of the straight road (n, 2) [m]."""
    lanes = {lane.id.partition(".")[2]: lane for lane in block.lanes}
    return np.array([(lanes[tag].path.start.y, lanes[tag].path.end.y) for tag in tags])


def test_a_split_opens_lanes_ahead_and_closes_those_that_come():
    for seed in range(20):
        road_map, block = block_of("Y", seed, 1, 3)
        count, after = len(road_map.start), len(road_map.goal)
        changed = after - count
        assert 1 <= changed <= 2 and after <= 3
        taper = [lane for lane in block.lanes if lane.id.startswith("1.bf")]
        np.testing.assert_allclose([lane.path.end.x - lane.path.start.x for lane in taper], 20.0 * changed)
        k = np.arange(1, changed + 1)
        outermost = (count - 0.5) * WIDTH
        opening = ends(block, *(f"bfopens{each}" for each in k))
        np.testing.assert_allclose(opening, np.stack([0 * k - outermost, -outermost - k * WIDTH], axis=1), atol=1e-9)
        closing = ends(block, *(f"bbcloses{each}" for each in k))
        np.testing.assert_allclose(closing, np.stack([outermost + k * WIDTH, 0 * k + outermost], axis=1), atol=1e-9)
        ranks = {lane.id.partition(".")[2]: (lane.junction, lane.rank) for lane in block.lanes}
        assert ranks[f"bb{count - 1}"] == (1, 1) and ranks["bbcloses1"] == (1, 0) and ranks["bfopens1"][0] == -1


def test_a_bottleneck_leaves_the_fewest_lanes():
    for seed in range(20):
        road_map, block = block_of("Yy", seed, 1, 3)
        before = sum(each.id.startswith("1.cf") and each.id[4].isdigit() for each in road_map.blocks[1].lanes)
        changed = before - len(road_map.goal)
        assert 1 <= changed <= 2 and len(road_map.goal) >= 1
        outermost = (len(road_map.goal) - 0.5) * WIDTH
        np.testing.assert_allclose(
            ends(block, "bfcloses1", "bbopens1"), [[-outermost - WIDTH, -outermost], [outermost, outermost + WIDTH]]
        )


def test_directions_share_one_lane_in_the_middle():
    for seed in range(8):
        road_map, block = block_of("B", seed, 1, 1)
        ahead, back = (next(lane for lane in block.lanes if lane.id == f"1.b{side}0") for side in "fb")
        assert 40.0 + 24.0 <= ahead.path.end.x - ahead.path.start.x <= 80.0 + 24.0
        np.testing.assert_allclose(ends(block, "bf0", "bb0"), [[-WIDTH / 2] * 2, [WIDTH / 2] * 2], atol=1e-9)
        for lane in (ahead, back):
            assert abs(lane.path.pose_at(lane.path.length / 2).y) < 1e-9
        assert ahead.junction == back.junction == 1 and ahead.rank > back.rank
        assert {ahead.axis, back.axis} in ({-1}, {0, 1})
        graph = make_graph(road_map)
        rows = [road_map.lanes.index(lane) for lane in (ahead, back)]
        assert graph.lanes.needs_grant[rows].all(), "nobody enters while others come"
        (conflict,) = graph.conflicts[graph.lanes.conflicts_begin[rows[0]] : graph.lanes.conflicts_end[rows[0]]]
        assert (conflict.lane, conflict.kind) == (rows[1], CROSS)
        assert conflict.own_begin < 12.0 and conflict.own_end > ahead.path.length - 12.0


def test_toll_gates_have_a_booth_on_every_line_between_lanes():
    for seed in range(8):
        road_map, block = block_of("$", seed, 1, 3)
        count = len(road_map.goal)
        gates = [lane for lane in block.lanes if lane.id[2] == "b"]
        assert len(gates) == 2 * count and len(block.obstacles) == 2 * count - 1
        assert all(lane.left is lane.right is None and lane.speed_limit == 3.0 for lane in gates)
        assert all(lane.speed_limit is None for lane in block.lanes if lane not in gates)
        lines = np.sort([each.y for each in block.obstacles])
        np.testing.assert_allclose(lines, np.arange(1 - count, count) * WIDTH, atol=1e-9)
        sides = [abs(lane.path.start.y - each.y) for lane in gates for each in block.obstacles]
        assert min(sides) - 0.3 > 2.5 / 2, "a bus fits"
        graph = make_graph(road_map)
        number = [row for row, lane in enumerate(road_map.lanes) if lane in gates]
        np.testing.assert_allclose(graph.lanes.speed[number], 3.0)
        assert block.obstacles[0].type == ObjectType.TRAFFIC_OBJECT
    assert WIDTH > TOLL_ROOM


def test_cars_are_parked_in_spaces_beside_the_road():
    taken = spaces = 0
    for seed in range(12):
        road_map, block = block_of("P", seed, 1, 1)
        areas = [shapely.Polygon(area.outline) for area in block.areas if area.type == MapFeatureType.CARPARK_AREA]
        assert len(areas) % 2 == 0 and 4 <= len(areas) <= 20
        road = shapely.unary_union([shapely.Polygon(lane.outline(WIDTH / 2)) for lane in road_map.lanes])
        for area in areas:
            assert area.area == pytest.approx(2.8 * 5.5) and area.intersection(road).area < 1e-6
        for car in block.obstacles:
            pose = shapely.box(-car.size[0] / 2, -car.size[1] / 2, car.size[0] / 2, car.size[1] / 2)
            turned = shapely.affinity.rotate(pose, car.heading, origin=(0, 0), use_radians=True)
            shape = shapely.affinity.translate(turned, car.x, car.y)
            assert sum(area.contains(shape) for area in areas) == 1
        taken, spaces = taken + len(block.obstacles), spaces + len(areas)
    assert 0.5 < taken / spaces < 0.9


def test_leftmost_lanes_lead_back():
    for seed in range(8):
        _, block = block_of("U", seed, 1, 3)
        back = [lane for lane in block.lanes if lane.id[2] == "x" and lane.id[3] == lane.id[6]]
        assert [lane.id[3:5] for lane in back] == ["00", "10", "20", "30"]
        box = next(shapely.Polygon(area.outline) for area in block.areas if area.type == MapFeatureType.INTERSECTION)
        for lane in back:
            assert np.cos(lane.path.end.heading - lane.path.start.heading) == pytest.approx(-1.0)
            assert lane.path.max_curvature <= 0.2 + 1e-9
            assert box.buffer(0.01).contains(shapely.Polygon(lane.outline(1.0)).buffer(0.0)), "a car stays on the road"


@pytest.mark.parametrize("sequence", LANES)
def test_traffic_passes_every_block(sequence):
    fewest, most = LANES[sequence]
    options = GeneratorOptions(version="v2", sequence=sequence, min_lanes=fewest, max_lanes=most)
    for seed in (0, 1) if sequence != "U" else (0,):
        episode = generate(seed, options)
        check_motion(episode)


@pytest.mark.long
@pytest.mark.parametrize(
    ("sequence", "share"), [("B", 0.9), ("Y", 1.0), ("Yy", 1.0), ("P", 1.0), ("$", 1.0), ("U", 0.7)]
)
def test_egos_arrive_behind_every_block(sequence, share):
    fewest, most = LANES[sequence]
    options = GeneratorOptions(version="v2", sequence=sequence, min_lanes=fewest, max_lanes=most, oncoming=1.0)
    episodes = [generate(seed, options) for seed in range(40)]
    for episode in episodes:
        check_motion(episode)
    assert np.mean([each.valid.shape[1] < options.max_steps for each in episodes]) >= share


@pytest.mark.parametrize("sequence", LANES)
def test_left_hand_traffic_mirrors_every_block(sequence):
    fewest, most = LANES[sequence]
    how = {"sequence": sequence, "min_lanes": fewest, "max_lanes": most, "max_steps": 40}
    right, left = scenario(2, "v2", **how), scenario(2, "v2", left_hand=True, **how)
    flip = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(
        (left.tracks.position + left.origin) * flip, right.tracks.position + right.origin, atol=1e-3
    )
    np.testing.assert_array_equal(left.map.speed_limit, right.map.speed_limit)
    if sequence == "$":
        assert set(left.map.speed_limit.tolist()) >= {3.0}


@pytest.mark.parametrize(("seed", "expected"), [(0, 9749291113831344326), (5, 12336352276515040804)])
def test_blocks_on_demand_leave_other_seeds_as_they_are(seed, expected):
    assert content_hash(scenario(seed, "v2")) == expected
