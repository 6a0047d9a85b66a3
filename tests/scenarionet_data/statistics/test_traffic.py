"""Figures of traffic, by hand: a car that follows another, one that changes lanes, one that is parked."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.statistics.traffic import count_lane_changes, measure_traffic
from tests.fixtures.drives import Other, make_drive

DT = 0.1


def test_gap_headway_and_speed_of_one_that_follows():
    scenario = make_drive("follow", others=(Other(30.0, vx=5.0),))
    figures = measure_traffic(scenario)
    tracks = scenario.tracks
    ego, other = (tracks.position[row, :, 0].astype(float) for row in (scenario.ego_index, 1 - scenario.ego_index))
    lengths = tracks.size[..., 0].reshape(2, -1)[:, 0].sum() / 2.0
    speed = np.hypot(*np.moveaxis(tracks.velocity[scenario.ego_index].astype(float), -1, 0))
    expected = (other - ego - lengths)[(other > ego) & (speed > 1.0)]
    np.testing.assert_allclose(figures.gap, expected[expected > 0.0], rtol=1e-5)
    assert set(np.round(figures.speed, 3)) >= {5.0}
    assert figures.lane_changes.tolist() == [0.0]


def path(left):
    """A track of 12 s at 10 m/s whose distance to the left is a function of time."""
    t = np.arange(0.0, 12.0, DT)
    position = np.stack([10.0 * t, left(t)], axis=-1)
    slope = np.gradient(position[:, 1], position[:, 0])
    return position, np.arctan(slope), np.ones(len(t), bool)


@pytest.mark.parametrize(
    ("left", "expected"),
    [
        (lambda t: 0.0 * t, 0),
        (lambda t: 3.5 * np.clip((t - 3.0) / 3.0, 0.0, 1.0), 1),
        (lambda t: -3.5 * np.clip((t - 3.0) / 3.0, 0.0, 1.0), 1),
        (lambda t: 1.5 * np.clip((t - 3.0) / 3.0, 0.0, 1.0), 0),
        (lambda t: 3.5 * np.clip((t - 0.5) / 3.0, 0.0, 1.0) - 3.5 * np.clip((t - 7.5) / 3.0, 0.0, 1.0), 2),
    ],
)
def test_lane_changes_are_displacements_by_a_lane(left, expected):
    assert count_lane_changes(*path(left), DT) == expected


def test_a_bend_is_no_lane_change():
    t = np.arange(0.0, 12.0, DT)
    angle = 0.1 * t
    position = 100.0 * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=-1)
    assert count_lane_changes(position, angle, np.ones(len(t), bool), DT) == 0
