"""Every statistic against an independent oracle, on random scenarios and on hand-made cases."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.building import MapBuilder, make_tracks
from scenarionet_data.scenario.description import Lights, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.schema.package_data import SCHEMAS
from scenarionet_data.statistics.summary import ego_path, has_intersection, path_curvature, path_distance, summarise
from tests.fixtures import oracle
from tests.fixtures.scenarios import make_scenario

LANE = MapFeatureType.LANE_SURFACE_STREET


def wandering(seed: int, **how) -> ScenarioDescription:
    """A random scenario whose objects, including the ego, wander with gaps, small steps and turns."""
    rng = np.random.default_rng(seed)
    scenario = make_scenario(seed, **how)
    tracks, shape = scenario.tracks, scenario.tracks.valid.shape
    valid = tracks.valid & (rng.random(shape) < 0.8)
    valid[0, scenario.current_timestep] = True
    steps = rng.normal(0, rng.choice([0.03, 0.3, 2.0], (*shape, 1)), (*shape, 3))
    position = (steps.cumsum(axis=1) + rng.uniform(-30, 30, (len(tracks), 1, 3))) * [1, 1, scenario.has_z]
    moved = {
        "position": position * valid[..., None],
        "velocity": rng.normal(0, 9, (*shape, 2)) * valid[..., None],
        "size": tracks.size * valid[..., None] * rng.uniform(0.2, 2, (*shape, 3)),
        "heading": wrap_angle(rng.uniform(-9, 9, shape)) * valid,
    }
    tracks = replace(tracks, valid=valid, **{name: array.astype(np.float32) for name, array in moved.items()})
    lights = Lights.empty(scenario.num_timesteps)
    if seed % 3 == 0:
        lights = replace(scenario.lights, is_lane_in_map=np.zeros(len(scenario.lights), np.bool_))
    return replace(scenario, tracks=tracks, lights=lights, map=crossing_map(rng, scenario.has_z, seed))


def crossing_map(rng, has_z, seed):
    """Lanes as random walks, lines and edges; some maps do not mark intersections, some scenarios have no map."""
    if seed % 7 == 0:
        return None
    builder = MapBuilder()
    for number in range(rng.integers(0, 8)):
        line = rng.normal(0, 40, (rng.integers(1, 8), 3)).cumsum(axis=0) + rng.uniform(-40, 40, 3)
        marked = bool(rng.random() < 0.3) if seed % 5 == 0 else None
        entries = [f"p{k}" for k in rng.integers(0, 5, rng.integers(0, 3))]
        builder.add(f"l{number}", LANE, polyline=line, entry_lanes=entries, is_intersection=marked)
    for number, kind in enumerate(rng.choice(list(MapFeatureType), rng.integers(0, 6))):
        builder.add(f"f{number}", kind, polyline=rng.uniform(-9, 9, (rng.integers(0, 4), 3)))
    return builder.build(np.zeros(3), has_z)


@given(st.integers(0, 100_000), st.integers(1, 9), st.integers(1, 12), st.booleans())
@settings(max_examples=2 * settings.default.max_examples)
def test_every_statistic_matches_its_oracle(seed, num_objects, num_steps, has_z):
    scenario = wandering(seed, num_objects=num_objects, num_steps=num_steps, has_z=has_z)
    scenario.validate()
    found, wanted = summarise(scenario), oracle.statistics(scenario)
    assert found.pop("num_dropped_rows") == 0
    assert found.keys() == wanted.keys()
    for name, value in wanted.items():
        assert type(found[name]) is type(value), name
        assert found[name] == (value if value is None else pytest.approx(value, rel=1e-5, abs=1e-4)), name


def test_random_scenarios_cover_all_cases():
    """The property test above is meaningful only if its cases differ."""
    rows = [summarise(wandering(seed, num_objects=4, num_steps=8)) for seed in range(120)]
    unmarked = [row["has_intersection"] for seed, row in enumerate(rows) if seed % 3 and seed % 5 and seed % 7]
    assert 5 < sum(unmarked) < len(unmarked) - 5
    assert any(row["min_ego_gap"] == 0 for row in rows)
    assert any(row["min_ego_gap"] is None for row in rows)
    assert any(row["map_height_diff"] is None for row in rows)
    assert any(0 < row["num_moving_objects"] < row["num_objects"] for row in rows)


def test_statistics_match_the_schema():
    """Exactly the columns of the section 'statistics' in metadata.toml."""
    text = (SCHEMAS / "metadata.toml").read_text()
    section = text.split("# --- statistics")[1].split("# --- addresses")[0].partition("\n")[2]
    assert set(summarise(make_scenario(1))) | {"extras"} == set(tomllib.loads(section)["columns"])


# --- hand-made cases ---------------------------------------------------------------------------------


def scene(paths, valid=None, size=(4.0, 2.0, 1.5), heading=0.0, **fields):
    """A scenario of objects on given paths (N, T, 2), the first of them the ego."""
    flat = np.asarray(paths, dtype=np.float64)
    count, steps = flat.shape[:2]
    tracks = make_tracks(
        [f"t{i}" for i in range(count)],
        np.full(count, ObjectType.VEHICLE),
        np.concatenate([flat, np.zeros((count, steps, 1))], axis=2),
        np.broadcast_to(np.reshape(heading, (-1, 1)), (count, steps)),
        np.zeros((count, steps, 2)),
        np.broadcast_to(size, (count, 3)),
        np.ones((count, steps)) if valid is None else valid,
        origin=np.zeros(3),
    )
    base = make_scenario(2, num_objects=1, num_steps=steps, has_map=False, num_lights=0)
    return replace(base, tracks=tracks, current_timestep=0, tracks_to_predict=(), **fields)


def test_distance_spans_gaps():
    path = [[(0, 0), (3, 4), (99, 99), (6, 8)]]
    row = summarise(scene(path, valid=[[1, 1, 0, 1]]))
    assert row["ego_distance"] == 10
    assert row["num_states"] == 3
    assert (row["min_x"], row["min_y"], row["max_x"], row["max_y"]) == (0, 0, 6, 8)


def test_curvature_of_a_circle_is_a_full_turn():
    for count, radius in ((12, 1.0), (100, 10.0), (1000, 50.0)):
        angle = np.arange(count + 2) * 2 * math.pi / count
        circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        assert path_curvature(circle) == pytest.approx(2 * math.pi)
        assert path_curvature(circle[::-1]) == pytest.approx(2 * math.pi)


def test_curvature_of_an_s_adds_both_turns_and_standstill_adds_none():
    bend = np.array([[0, 0], [1, 0], [1, 1], [2, 1.0]])
    assert path_curvature(bend) == pytest.approx(math.pi)
    rng = np.random.default_rng(0)
    jitter = rng.normal(0, 0.01, (100, 2))
    assert path_curvature(jitter) == 0
    assert path_distance(jitter) > 0.5
    row = summarise(scene([bend]))
    assert row["difficulty"] == pytest.approx(3 * math.pi)


@pytest.mark.parametrize(("other", "gap"), [((3.9, 1.9), 0.0), ((4.0, 0.0), 0.0), ((9.0, 0.0), 5.0), ((7.0, 6.0), 5.0)])
def test_ego_gap_is_between_boxes_and_zero_where_they_overlap(other, gap):
    assert summarise(scene([[(0, 0)], [other]]))["min_ego_gap"] == pytest.approx(gap, abs=1e-6)


def test_ego_gap_needs_both_objects_at_one_timestep():
    apart = scene([[(0, 0), (0, 0)], [(1, 0), (30, 0)]], valid=[[1, 0], [0, 1]])
    assert summarise(apart)["min_ego_gap"] is None
    together = scene([[(0, 0), (0, 0)], [(1, 0), (30, 0)]], valid=[[1, 1], [0, 1]])
    assert summarise(together)["min_ego_gap"] == pytest.approx(26.0)


def test_moving_means_more_than_a_metre():
    paths = [[(0, 0), (0, 0)], [(9, 0), (10, 0)], [(20, 0), (21.01, 0)]]
    assert summarise(scene(paths))["num_moving_objects"] == 1


def crossing(degrees, at=(0.0, 0.0), first=("a",), second=("b",)):
    """Two lanes of 40 m that cross at a point."""
    builder = MapBuilder()
    for name, turn, entries in (("a", 0.0, first), ("b", math.radians(degrees), second)):
        reach = 20 * np.array([math.cos(turn), math.sin(turn)])
        builder.add(name, LANE, polyline=[at - reach, at + reach], entry_lanes=entries)
    return builder.build(np.zeros(3))


@pytest.mark.parametrize(
    ("degrees", "is_found"), [(31, True), (29, False), (90, True), (149, True), (151, False), (-31, True)]
)
def test_lanes_cross_at_more_than_thirty_degrees(degrees, is_found):
    assert summarise(scene([[(0, 5), (9, 5)]], map=crossing(degrees)))["has_intersection"] == is_found


@pytest.mark.parametrize(("y", "is_found"), [(49, True), (51, False), (-49, True), (-51, False)])
def test_lanes_cross_within_fifty_metres_of_the_path(y, is_found):
    scenario = scene([[(-9, y), (9, y)]], map=crossing(90))
    assert summarise(scenario)["has_intersection"] == is_found


def test_curved_path_excludes_distant_crossing():
    """The crossing must be near the path, not merely inside its bounding box."""
    around = scene([[(-200, -200), (200, -200), (200, 200)]], map=crossing(90, at=(0, 0)))
    assert not summarise(around)["has_intersection"]


def test_long_segments_passing_nearby_are_included():
    """Both lanes have their ends far away from the path."""
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[-900, 0], [900, 0]])
    builder.add("b", LANE, polyline=[[0, -900], [0, 900]])
    assert summarise(scene([[(0, 5), (9, 5)]], map=builder.build(np.zeros(3))))["has_intersection"]


@pytest.mark.parametrize("mirror", [1, -1])
def test_every_crossing_of_two_lanes_counts(mirror):
    """One crossing is flat, the other steep, in either order."""
    builder = MapBuilder()
    builder.add("a", LANE, polyline=np.array([[0, 0], [100, 0]]) * [mirror, 1])
    builder.add("b", LANE, polyline=np.array([[5, -1], [15, 1], [50, 1], [50, -30]]) * [mirror, 1])
    scenario = scene([[(30 * mirror, 5), (31 * mirror, 5)]], map=builder.build(np.zeros(3)))
    assert summarise(scenario)["has_intersection"]


def test_angle_is_measured_at_the_crossing():
    """A long steep segment passes close by; the crossing one is flat."""
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[0, 0], [40, 0]])
    builder.add("b", LANE, polyline=[[17, -0.01], [20, 0.19], [-10, 30.19]])
    assert not summarise(scene([[(20, 5), (21, 5)]], map=builder.build(np.zeros(3))))["has_intersection"]


@pytest.mark.parametrize(
    ("first", "second", "is_found"),
    [(["p"], ["p"], False), (["p", "q"], ["q"], False), (["p"], ["q"], True), ([], [], True)],
)
def test_lanes_diverging_from_one_predecessor_do_not_cross(first, second, is_found):
    scenario = scene([[(0, 5), (9, 5)]], map=crossing(90, first=first, second=second))
    assert summarise(scenario)["has_intersection"] == is_found


def test_merging_and_successive_lanes_do_not_cross():
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[-20, 0], [0, 0]])
    builder.add("b", LANE, polyline=[[-20, -20], [0, 0]], entry_lanes=["x"])
    builder.add("c", LANE, polyline=[[0, 0], [0, 20]], entry_lanes=["a", "b"])
    assert not summarise(scene([[(0, 5), (9, 5)]], map=builder.build(np.zeros(3))))["has_intersection"]


def test_only_lanes_can_cross():
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[-20, 0], [20, 0]])
    builder.add("b", MapFeatureType.ROAD_EDGE_BOUNDARY, polyline=[[0, -20], [0, 20]])
    builder.add("c", LANE, polyline=[[0, 5]])
    assert not summarise(scene([[(0, 5), (9, 5)]], map=builder.build(np.zeros(3))))["has_intersection"]


def test_lights_and_source_annotations_take_precedence():
    still = scene([[(0, 5)]])
    lit = replace(still, lights=make_scenario(2, num_steps=1, num_lights=1, num_lanes=0).lights)
    assert has_intersection(lit, ego_path(lit))
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[-20, 0], [20, 0]], is_intersection=False)
    builder.add("b", LANE, polyline=[[0, -20], [0, 20]])
    denied = replace(still, map=builder.build(np.zeros(3)))
    assert not has_intersection(denied, ego_path(denied))
    builder.add("c", MapFeatureType.INTERSECTION, is_intersection=True)
    marked = replace(still, map=builder.build(np.zeros(3)))
    assert has_intersection(marked, ego_path(marked))
    assert not has_intersection(still, ego_path(still))
