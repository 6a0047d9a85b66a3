"""Building canonical arrays from source data: offsets, zeros where invalid, wrapped headings, ids as str."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.building import METRES, MapBuilder, StateGrid, make_origin, make_tracks
from scenarionet_data.building import tracks as tracks_module
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.testing import differences
from tests.fixtures.scenarios import make_scenario

ORIGIN = np.array([4_000_000.0, 600_000.0, 30.0])


def tracks(**changes):
    """Two objects over three steps, the second valid only at the middle step; arbitrary values where invalid."""
    valid = np.array([[1, 1, 1], [0, 1, 0]])
    rubbish = np.array([[0.0, 0, 0], [np.nan, 0, 1e300]])
    fields = {
        "ids": [7, "b"],
        "object_type": [ObjectType.VEHICLE, ObjectType.PEDESTRIAN],
        "position": ORIGIN + np.arange(18).reshape(2, 3, 3) / 7 + rubbish[..., None],
        "heading": np.array([[0.0, math.pi, 9.0], [np.nan, -0.5, np.inf]]),
        "velocity": np.ones((2, 3, 2)) + rubbish[..., None],
        "size": np.array([[4.0, 2.0, 1.5], [0.5, 0.6, 1.8]]),
        "valid": valid,
        "origin": ORIGIN,
    }
    return make_tracks(**(fields | changes))


def test_tracks_are_canonical_for_any_values_at_invalid_steps():
    made = tracks()
    scenario = make_scenario(num_steps=3, has_map=False, num_lights=0)
    replace(scenario, tracks=made, ego_id="7", objects_of_interest=(), tracks_to_predict=()).validate()
    assert made.ids.tolist() == ["7", "b"]
    for array in (made.position, made.heading, made.velocity, made.size):
        assert array.dtype == np.float32
        assert not array[~made.valid].any()
    assert made.position[0] == pytest.approx(np.arange(9).reshape(3, 3) / 7, abs=METRES / 2)
    assert made.heading[0] == pytest.approx([0.0, -math.pi, 9.0 - 2 * math.pi])
    assert made.size[1, 1].tolist() == pytest.approx([0.5, 0.6, 1.8])
    assert made.source_type.tolist() == [None, None]
    assert made.extras.tolist() == [None, None]


def test_other_array_types_cause_no_recompilation():
    made = tracks()
    compiled = tracks_module.fill_poses.signatures, tracks_module.fill_sizes.signatures
    velocity = np.array([[0.25, 0.5], [1.0, 2.0]])
    velocity.flags.writeable = False
    again = tracks(
        position=np.broadcast_to(ORIGIN, (2, 3, 3)),
        heading=np.zeros((3, 2), np.float32).T,
        velocity=velocity[:, None],
        size=made.size.astype(np.float64)[:, ::-1],
    )
    assert (tracks_module.fill_poses.signatures, tracks_module.fill_sizes.signatures) == compiled
    assert again.velocity[0, 2].tolist() == [0.25, 0.5]


@pytest.mark.parametrize("field", ["position", "heading", "velocity", "size"])
def test_number_beyond_float32_fails_validation(field):
    shape = {"position": (2, 3, 3), "heading": (2, 3), "velocity": (2, 3, 2), "size": (2, 3, 3)}[field]
    values = np.ones(shape)
    values[0, 1] = np.inf if field == "heading" else 1e300
    scenario = make_scenario(num_steps=3, has_map=False, num_lights=0)
    with pytest.raises(InvalidScenario, match=rf"tracks\.{field}: wanted finite"):
        replace(scenario, tracks=tracks(**{field: values})).validate()


def test_negative_zero_is_not_stored():
    made = tracks(velocity=np.full((2, 3, 2), -0.0), position=np.broadcast_to(ORIGIN, (2, 3, 3)))
    assert not np.signbit(made.velocity).any()
    assert not np.signbit(made.position).any()
    assert not np.signbit(make_origin(np.array([[-0.2, -0.4, -0.1]]), np.array([True]), True)).any()


def test_flags_and_labels_per_object_or_for_all():
    made = tracks(
        size=np.ones((2, 3, 3)),
        is_size_assumed=True,
        is_type_assumed=[False, True],
        source_type=["car", None],
        extras=[{"b": 1, "a": 2}, None],
    )
    assert made.is_size_assumed.tolist() == [True, True]
    assert made.is_type_assumed.tolist() == [False, True]
    assert made.is_velocity_estimated.tolist() == [False, False]
    assert made.source_type.tolist() == ["car", None]
    assert made.extras.tolist() == ['{"a":2,"b":1}', None]
    made.is_size_assumed[0] = False
    assert made.is_size_assumed[1]


def test_interpolated_steps_are_flagged_where_valid():
    valid = np.array([[True, True, True], [False, True, True]])
    made = tracks(valid=valid, is_interpolated=[False, True, False])
    assert made.is_interpolated.tolist() == [[False, True, False], [False, True, False]]
    assert tracks(valid=valid).is_interpolated.tolist() == np.zeros((2, 3), bool).tolist()


@given(st.floats(-1000, 1000), st.floats(-1000, 1000), st.floats(-1e7, 1e7))
def test_offsets_are_exact_to_a_tenth_of_a_millimetre_within_a_kilometre(x, y, far):
    origin = np.round([far, -far, 0.0])
    position = np.broadcast_to(origin + np.array([x, y, 3.0]), (2, 3, 3))
    back = tracks(position=position, origin=origin).position[0].astype(np.float64) + origin
    assert np.abs(back - position[0]).max() <= 1e-4


def test_origin_is_the_first_valid_position_in_whole_metres():
    position = np.array([[np.nan] * 3, [10.4, -3.6, 7.5], [99.0, 99.0, 99.0]])
    valid = np.array([False, True, True])
    assert make_origin(position, valid, True).tolist() == [10.0, -4.0, 8.0]
    assert make_origin(position, valid, False).tolist() == [10.0, -4.0, 0.0]
    assert make_origin(position, valid, True).dtype == np.float64


def test_map_builder_accepts_points_in_2d_and_3d():
    builder = MapBuilder()
    builder.add("a", MapFeatureType.LANE_FREEWAY, polyline=[[0, 0], [1, 2]], width=[1.5, 1.6], exit_lanes=[3])
    builder.add(4, MapFeatureType.CROSSWALK, polygon=[[0, 0, 5], [1, 0, 5], [1, 1, 5]], is_intersection=True)
    assert len(builder) == 2
    features = builder.build(np.array([0.0, 0.0, 1.0]))
    replace(make_scenario(num_lights=0), map=features).validate()
    assert features.ids.tolist() == ["a", "4"]
    assert features.polyline[0].tolist() == [[0, 0, -1], [1, 2, -1]]
    assert features.polygon[1][:, 2].tolist() == [4, 4, 4]
    assert features.width[0] == pytest.approx(np.array([[1.5, 1.6]]))
    assert features.exit_lanes[0].tolist() == ["3"]
    assert features.is_intersection.tolist() == [-1, 1]
    assert np.isnan(features.speed_limit).all()


def test_map_without_heights_is_at_zero_and_can_be_built_twice():
    builder = MapBuilder()
    builder.add("a", MapFeatureType.ROAD_EDGE_BOUNDARY, polyline=[[5.0, 5.0, 3.0], [6.0, 5.0, 4.0]])
    flat = builder.build(np.array([5.0, 5.0, 0.0]), has_z=False)
    assert flat.polyline[0].tolist() == [[0, 0, 0], [1, 0, 0]]
    assert builder.build(np.zeros(3)).polyline[0][:, 2].tolist() == [3, 4]


def test_empty_map_is_valid():
    replace(make_scenario(num_lights=0), map=MapBuilder().build(np.zeros(3))).validate()


@given(st.floats(-1000, 1000), st.floats(-4, 4))
def test_noise_below_the_resolution_is_removed(metres, radians):
    made = make_tracks(
        ["a"], [1], np.full((1, 1, 3), metres), np.full((1, 1), radians), np.full((1, 1, 2), metres / 10),
        np.full((1, 3), 4.6), np.ones((1, 1), bool), origin=np.zeros(3),
    )  # fmt: skip
    steps = made.position / METRES
    assert np.array_equal(steps, np.rint(steps))
    assert abs(float(made.position[0, 0, 0]) - metres) <= METRES
    turn = (float(made.heading[0, 0]) - radians + math.pi) % (2 * math.pi) - math.pi
    assert abs(turn) <= 1e-6
    assert -np.float32(np.pi) <= made.heading[0, 0] < np.float32(np.pi)


def test_constant_sizes_are_stored_exactly():
    size = np.broadcast_to([4.6, 1.9, 1.5], (2, 5, 3)).copy()
    size[1, :, 0] += np.linspace(0, 0.1, 5)
    made = make_tracks(
        ["a", "b"], [1, 1], np.zeros((2, 5, 3)), np.zeros((2, 5)), np.zeros((2, 5, 2)), size, np.ones((2, 5), bool),
        origin=np.zeros(3),
    )  # fmt: skip
    assert made.size[0, 0].tolist() == np.float32([4.6, 1.9, 1.5]).tolist()
    assert made.size[1, 0, 1] == pytest.approx(1.9, abs=METRES)
    assert np.array_equal(made.size[1, :, 0] / METRES, np.rint(made.size[1, :, 0] / METRES))


@given(st.integers(0, 2**32 - 1))
def test_rows_on_a_grid_give_the_tracks_of_the_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, steps = int(rng.integers(0, 5)), int(rng.integers(1, 7))
    valid = rng.random((count, steps)) < 0.5
    position, velocity = rng.normal(0.0, 1e3, (count, steps, 3)), rng.normal(0.0, 1.0, (count, steps, 2))
    heading = rng.choice([-np.pi, np.pi, 0.0, -0.0, 1.0], (count, steps))
    size = np.where(rng.random((count, 1, 1)) < 0.5, rng.random((count, 1, 3)), rng.random((count, steps, 3))) + 0.1
    ids, kinds, origin = [str(k) for k in range(count)], [1] * count, np.array([5.0, -3.0, 1.0])
    order = rng.permutation(np.count_nonzero(valid))
    track, timestep = (rows[order] for rows in np.nonzero(valid))
    grid = StateGrid(track, timestep, (count, steps))
    assert grid.valid.tolist() == valid.tolist()
    placed = [grid.place(values[track, timestep]) for values in (position, heading, velocity, size)]
    wanted = make_tracks(ids, kinds, position, heading, velocity, size, valid, origin=origin)
    assert differences(make_tracks(ids, kinds, *placed, grid.valid, origin=origin), wanted) == []
