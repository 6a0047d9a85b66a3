"""Maps over many seeds: lanes connect without overlap, and every block type is drawn and drivable."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import shapely

from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural.generate import make_map
from scenarionet_data.procedural.graph import make_graph
from scenarionet_data.procedural.options import BLOCK_NAMES, LETTERS, GeneratorOptions
from scenarionet_data.scenario.vocabulary import MapFeatureType


def draw(seed, **options):
    return make_map(GeneratorOptions(**options), np.random.Generator(np.random.PCG64(seed)))


LANES = {"B": (1, 1), "P": (1, 1), "Y": (1, 3), "Yy": (1, 3), "$": (1, 3), "U": (1, 3)}
"""Fewest and most lanes for sequences of blocks that are drawn only on demand."""
MAPS = [(seed, {}) for seed in range(25)] + [
    (seed, {"sequence": sequence, "min_lanes": fewest, "max_lanes": most})
    for sequence, (fewest, most) in LANES.items()
    for seed in range(4)
]
SOME = [(name, seed) for name in BLOCK_NAMES for seed in range(3)]


def one(name, seed):
    most = {"merge": 2, "bidirection": 1, "parking_lot": 1}.get(name, 3)
    options = {"min_lanes": 1, "max_lanes": most}
    weights = f"{name}=1 straight=0.001"
    return draw(seed, num_blocks=1, blocks=weights, **options)


@pytest.mark.parametrize(("seed", "options"), MAPS)
def test_successive_lanes_join_smoothly(seed, options):
    road_map = draw(seed, **options)
    lanes = {lane.id: lane for lane in road_map.lanes}
    assert len(lanes) == len(road_map.lanes)
    for before, after in road_map.links:
        end, start = lanes[before].path.end, lanes[after].path.start
        assert np.hypot(end.x - start.x, end.y - start.y) < 1e-6
        assert abs(np.angle(np.exp(1j * (end.heading - start.heading)))) < 1e-9


@pytest.mark.parametrize(("seed", "options"), MAPS)
def test_lanes_overlap_only_at_splits_merges_and_crossings(seed, options):
    road_map = draw(seed, **options)
    lanes = road_map.lanes
    shapes = [shapely.make_valid(shapely.Polygon(lane.outline(road_map.road.lane_width / 2))) for lane in lanes]
    entries, exits = {}, {}
    for before, after in road_map.links:
        exits.setdefault(before, set()).add(after)
        entries.setdefault(after, set()).add(before)
    for (a, first), (b, second) in combinations(zip(lanes, shapes, strict=True), 2):
        if a.is_intersection and b.is_intersection:
            continue
        is_split = entries.get(a.id, set()) & entries.get(b.id, set())
        is_join = exits.get(a.id, set()) & exits.get(b.id, set())
        if not is_split and not is_join:
            assert first.intersection(second).area < 0.2, (a.id, b.id)


@pytest.mark.parametrize(("seed", "options"), MAPS)
def test_ids_refer_to_the_map(seed, options):
    road_map = draw(seed, **options)
    lanes = {lane.id for lane in road_map.lanes}
    lines = [line.id for block in road_map.blocks for line in block.lines]
    areas = [area.id for block in road_map.blocks for area in block.areas]
    assert len({*lanes, *lines, *areas}) == len(lanes) + len(lines) + len(areas)
    for lane in road_map.lanes:
        assert {lane.left, lane.right} - {None} <= lanes
        assert {*lane.left_boundaries, *lane.right_boundaries} <= set(lines)
    by_id = {lane.id: lane for lane in road_map.lanes}
    assert all(by_id[lane.left].right == lane.id for lane in road_map.lanes if lane.left)
    assert {*road_map.start, *road_map.goal} <= lanes


@pytest.mark.parametrize(("name", "seed"), SOME)
def test_every_block_type_leads_to_the_goal(name, seed):
    road_map = one(name, seed)
    graph = make_graph(road_map)
    number = {lane.id: row for row, lane in enumerate(road_map.lanes)}
    assert np.isfinite(graph.routes.cost[0, [number[lane] for lane in road_map.start]]).all()
    assert np.isfinite(graph.routes.cost).any(axis=0).all(), "a lane that leads nowhere"


def test_every_block_type_is_drawn():
    names = {block.name for seed in range(60) for block in draw(seed).blocks}
    assert names == {"start", *BLOCK_NAMES[:9]}
    names = {block.name for seed in range(150) for block in draw(seed, blocks="all").blocks}
    assert names == {"start", *BLOCK_NAMES}


def test_intersection_has_crosswalks_stop_lines_and_turns_in_all_directions():
    road_map = draw(1, num_blocks=1, blocks="intersection=1", min_lanes=2, max_lanes=2)
    block = road_map.blocks[1]
    kinds = [area.type for area in block.areas] + [line.type for line in block.lines]
    assert kinds.count(MapFeatureType.CROSSWALK) == kinds.count(MapFeatureType.STOP_LINE) == 4
    turns = [lane for lane in block.lanes if lane.is_intersection]
    change = [lane.path.end.heading - lane.path.start.heading for lane in turns]
    assert {round(float(np.sin(angle))) for angle in change} == {-1, 0, 1}


def test_crosswalks_span_the_road_outside_the_corners():
    road_map = draw(1, num_blocks=1, blocks="intersection=1", min_lanes=2, max_lanes=2)
    block = road_map.blocks[1]
    surface = shapely.unary_union([*block.footprint]).buffer(0.05)
    for area in block.areas:
        if area.type == MapFeatureType.CROSSWALK:
            assert surface.contains(shapely.Polygon(area.outline))


@pytest.mark.parametrize(("lanes", "seed"), [(1, 0), (2, 1)])
def test_roundabout_islands_are_not_road(lanes, seed):
    block = draw(seed, num_blocks=1, blocks="roundabout=1", min_lanes=lanes, max_lanes=lanes).blocks[1]
    areas = [shapely.Polygon(area.outline) for area in block.areas if area.type == MapFeatureType.INTERSECTION]
    surface = shapely.unary_union(areas)
    assert all(area.is_valid for area in areas)
    assert sum(area.area for area in areas) == pytest.approx(surface.area, rel=2e-3), "they overlap"
    circles = [shapely.Polygon(line.points) for line in block.lines if line.id.endswith("circle0")]
    splitters = [shapely.make_valid(shapely.Polygon(line.points)) for line in block.lines if "splitter" in line.id]
    assert len(circles) == 1 and len(splitters) == 4
    for island in (*circles, *splitters):
        assert island.intersection(surface).area < 0.01 * island.area
        assert island.intersection(shapely.convex_hull(surface)).area > 0.9 * island.area
    for lane in block.lanes:
        if lane.is_intersection:
            points, _ = lane.path.offset(0.0).sample(1.0)
            assert shapely.contains_xy(surface.buffer(0.05), *points.T).all(), lane.id


def test_fork_adds_a_lane_and_merge_removes_one():
    assert len(draw(0, num_blocks=1, blocks="fork=1", max_lanes=2, min_lanes=1).goal) == 2
    merged = draw(0, num_blocks=1, blocks="merge=1 straight=0.0001", min_lanes=1, max_lanes=2)
    assert merged.blocks[1].name in ("merge", "straight")


@pytest.mark.parametrize("sequence", ["S", "SXO", "CrRT", "FSfC", "$UYy"])
def test_a_sequence_of_letters_names_the_blocks(sequence):
    names = [block.name for block in draw(3, sequence=sequence, num_blocks=7, min_lanes=1, max_lanes=2).blocks]
    assert names == ["start", *(LETTERS[letter] for letter in sequence)]


def test_blocks_that_never_fit_raise_error():
    with pytest.raises(BadParameter, match="never fit together"):
        draw(0, blocks="roundabout=1", min_lanes=3, max_lanes=3)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"blocks": "spiral=1"}, "spiral"),
        ({"sequence": "SQX"}, "sequence: 'SQX' has Q"),
        ({"blocks": "curve"}, "curve"),
        ({"blocks": "curve=0"}, "weight"),
        ({"density": -1.0}, "density"),
        ({"min_lanes": 4}, "lanes"),
        ({"dt": 0.0}, "dt"),
    ],
)
def test_options_outside_their_range_are_named(options, word):
    with pytest.raises(BadParameter, match=word):
        GeneratorOptions(**options).check()
