"""The features of a scenario: values computed by hand, and what they do not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.embeddings import features
from scenarionet_data.scenario.vocabulary import ObjectType
from tests.fixtures.near_duplicates import disguised
from tests.fixtures.scenarios import make_scenario


@pytest.fixture
def drive():
    """An ego that drives 3 s at 10 m/s along +x; a car 20 m ahead at 8 m/s, and a pedestrian 6 m to its left."""
    made = make_scenario(0, num_objects=3, num_steps=31, num_lights=0, has_map=False)
    tracks, time = made.tracks, made.timestamps
    ego = tracks.index(made.ego_id)
    lead, walker = (row for row in range(3) if row != ego)
    position, velocity = np.zeros_like(tracks.position), np.zeros_like(tracks.velocity)
    position[ego, :, 0], position[lead, :, 0] = 10 * time, 20 + 8 * time
    position[walker, :, 0], position[walker, :, 1] = 10 * time, 6.0
    velocity[ego, :, 0], velocity[lead, :, 0], velocity[walker, :, 0] = 10.0, 8.0, 10.0
    kind = np.full(3, ObjectType.VEHICLE, np.uint8)
    kind[walker] = ObjectType.PEDESTRIAN
    size = np.broadcast_to(np.float32([4.0, 2.0, 1.5]), tracks.size.shape)
    here = np.ones_like(tracks.valid)
    tracks = replace(
        tracks, position=position, velocity=velocity, heading=np.zeros_like(tracks.heading), valid=here,
        object_type=kind, size=size,
    )  # fmt: skip
    return replace(made, tracks=tracks, map=None)


def test_values_by_hand(drive):
    found = features.measure(drive)
    # Seconds are averaged: positions 4.5, 14.5, 24.5 and, of the last timestep alone, 30 m.
    assert found["ego_distance"] == pytest.approx(np.log1p(25.5), abs=1e-4)
    assert found["ego_speed_3"] == pytest.approx(10.0, abs=1e-5)
    assert found["ego_straightness"] == pytest.approx(1.0)
    assert found["ego_turning"] == found["ego_standing"] == found["ego_braking"] == 0.0
    assert found["vehicles"] == pytest.approx(np.log1p(1))  # one of each at a time, the ego not counted
    assert found["pedestrians"] == pytest.approx(np.log1p(1))
    assert found["cyclists"] == found["crossing"] == 0.0
    assert found["nearest"] == pytest.approx(6.0)
    assert found["nearest_soft"] == pytest.approx(6.0)
    assert found["lead"] == 1.0
    ahead = 20 - 2 * np.array([0.45, 1.45, 2.45, 3.0]) - 4.0  # bumper to bumper
    assert found["lead_gap"] == pytest.approx(ahead.mean(), abs=1e-4)
    assert found["headway"] == pytest.approx(ahead.mean() / 10, abs=1e-4)
    assert found["closing"] == pytest.approx(2.0, abs=1e-4)
    assert found["speeds_3"] == 1.0  # 8 m/s is in the bin from 8 to 14
    assert found["ego_lags"] == pytest.approx(-2.0, abs=1e-4)
    assert np.isnan(found["lanes"])  # without a map


def test_vector_is_standardised_and_zero_where_nothing_is_known(drive):
    vector, known = features.vector(drive), features.standard()
    assert vector.shape == (64,) == (len(known.names),)
    assert vector.dtype == np.float32
    assert tuple(features.measure(drive)) == known.names
    assert vector[known.names.index("lanes")] == 0.0
    place = known.names.index("ego_speed_3")
    assert vector[place] == pytest.approx((10.0 - known.mean[place]) / known.scale[place], abs=1e-5)
    assert np.abs(vector).max() <= 4.0
    assert (known.scale > 0).all()


def test_vector_does_not_depend_on_place_and_direction():
    made = make_scenario(4, num_steps=61)
    moved = disguised(made, np.random.default_rng(0), noise=0.0, dropped=0.0)
    np.testing.assert_allclose(features.vector(moved), features.vector(made), atol=2e-3)


def test_leader_is_found_in_any_direction(drive):
    wanted = features.measure(drive)
    for seed in range(4):
        found = features.measure(disguised(drive, np.random.default_rng(seed), noise=0.0, dropped=0.0))
        assert (found["lead"], found["crossing"]) == (1.0, 0.0)
        assert found["lead_gap"] == pytest.approx(wanted["lead_gap"], abs=1e-2)


def test_scenario_of_a_single_timestep_has_a_vector():
    assert np.isfinite(features.vector(make_scenario(1, num_steps=1))).all()
