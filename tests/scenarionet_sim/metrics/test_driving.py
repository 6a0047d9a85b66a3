"""Progress and collisions against hand-computed values."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.nuplan.scoring import progress_ratio
from scenarionet_sim.metrics.results.collisions import Collisions, count_collisions
from scenarionet_sim.metrics.results.recording import displacement, mean_speed


def test_mean_speed():
    assert mean_speed(np.array([[3.0, 4.0], [0.0, 1.0]])) == 3.0


def test_displacement_over_the_shorter_length():
    driven = np.array([[0.0, 0.0], [3.0, 0.0], [6.0, 0.0], [9.0, 0.0]])
    recorded = np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 2.0]])
    assert displacement(driven, recorded, np.ones(3, bool)) == (2.0, 2.0)
    assert displacement(driven[:2], recorded, np.ones(3, bool)) == (2.0, 4.0)
    assert displacement(driven, recorded, np.array([True, False, True])) == (1.0, 2.0)
    assert np.isnan(displacement(driven, recorded, np.zeros(3, bool))).all()


@pytest.mark.parametrize(
    ("driven", "recorded", "ratio"),
    [
        (50.0, 100.0, 0.5),
        (150.0, 100.0, 1.0),
        (-2.5, 100.0, 0.0),
        (-1.0, 100.0, 0.02),
        (0.0, 0.0, 1.0),
        (1.0, 4.0, 0.5),
    ],
)
def test_progress_ratio(driven, recorded, ratio):
    assert progress_ratio(driven, recorded) == ratio


def test_collisions_by_type():
    types = np.array([ObjectType.VEHICLE, ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST,
                      ObjectType.TRAFFIC_CONE, ObjectType.VEHICLE, ObjectType.VEHICLE], np.uint8)  # fmt: skip
    contacts = np.zeros((6, 7), bool)
    contacts[2:4, 1] = contacts[1, 2] = contacts[3, 3] = contacts[5, 5] = True
    contacts[2, 4] = contacts[4:, 4] = True  # the cone is hit twice
    contacts[:3, 6] = True  # overlaps in the recording
    found = count_collisions(contacts, types)
    assert found == Collisions(vehicles=2, humans=2, objects=1, cost=6, first=1)
    assert count_collisions(np.zeros((5, 7), bool), types) == Collisions(0, 0, 0, 0, None)
