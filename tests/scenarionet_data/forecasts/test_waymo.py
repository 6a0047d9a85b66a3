"""Scores of Waymo's motion challenges on the cases of the owner's ``motion_metrics_test.cc``, and by hand."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.building import make_tracks
from scenarionet_data.forecasts.waymo import (
    LEFT_TURN,
    LEFT_U_TURN,
    RIGHT_TURN,
    STATIONARY,
    STRAIGHT,
    STRAIGHT_LEFT,
    STRAIGHT_RIGHT,
    AveragePrecision,
    Horizon,
    WaymoChallenge,
    measure,
    trajectory_shape,
)

DIAGONAL = [[4, 4], [6, 6], [8, 8], [10, 10]]
LEFTWARD = [[-2, 0], [-3, 0], [-4, 0], [-5, 0]]
CHALLENGE = WaymoChallenge(stride=1, horizons=(Horizon(0.3, 3, 1.0, 2.0),), scales=(1.0, 1.0))
SCALED = WaymoChallenge(stride=1, horizons=CHALLENGE.horizons, scales=(0.5, 1.0))


def two_tracks(speeds=((20.0, 20.0), (-10.0, 0.0)), size=(1.0, 1.0)):
    """The owner's scenario: a vehicle along the diagonal, another to the left."""
    path = np.array([[[2, 2], *DIAGONAL], [[-1, 0], *LEFTWARD]], dtype=np.float64)
    velocity = np.zeros((2, 5, 2))
    velocity[:, 0] = speeds
    heading = np.broadcast_to(np.array([[np.pi / 4], [3.14159]]), (2, 5))
    return make_tracks(
        ["1", "2"],
        np.array([1, 1]),
        np.concatenate([path, np.zeros((2, 5, 1))], axis=-1),
        heading,
        velocity,
        np.broadcast_to([*size, 1.0], (2, 5, 3)),
        np.ones((2, 5), bool),
        origin=np.zeros(3),
    )


def joint(first=DIAGONAL, second=LEFTWARD, challenge=CHALLENGE, tracks=None, confidence=0.5):
    """One joint prediction of both."""
    modes = np.array([[first, second]], dtype=np.float64)
    tracks = two_tracks() if tracks is None else tracks
    return measure(tracks, 0, (0, 1), modes, np.array([confidence]), challenge.horizons[0], challenge)


def mean_precision(*measurements, is_soft=False):
    found = AveragePrecision(is_soft)
    for each in measurements:
        found.add(each)
    return found.value()


@pytest.mark.parametrize(
    ("how", "miss"),
    [
        ({}, 0.0),
        ({"second": [[-2, 1.01], [-3, 1.01], [-4, 1.01], [-5, 1.01]]}, 1.0),
        ({"first": [[4, 4], [6, 6], [8, 8], [9.292, 10.708]]}, 1.0),
        ({"second": [[-2, 0], [-3, 0], [-4, 0], [-7.01, 0]]}, 1.0),
        ({"first": [[4, 4], [6, 6], [8, 8], [11.415, 11.415]]}, 1.0),
        ({"first": [[4, 4], [6, 6], [8, 8], [11.414, 11.414]]}, 0.0),
    ],
)
def test_misses_of_joint_predictions(how, miss):
    """ComputeMissRateNoMisses, Lateral_2, Lateral_1, Longitudinal_2, Longitudinal_1, NoMissLongitudinal_1."""
    found = joint(**how)
    assert found.miss == miss
    assert mean_precision(found) == 1.0 - miss


def test_limits_grow_with_the_speed():
    """Half the limit below 1.4 m/s, three quarters halfway to 11 m/s."""
    aside = [[-2, 0.6], [-3, 0.6], [-4, 0.6], [-5, 0.6]]
    for speed, miss in ((0.5, 1.0), (6.2, 0.0), (5.0, 0.0), (3.0, 1.0)):
        tracks = two_tracks(((20.0, 20.0), (-speed, 0.0)))
        assert joint(second=aside, challenge=SCALED, tracks=tracks).miss == miss


def test_displacements_are_means_over_the_objects():
    shifted = [[x + 1.0, y] for x, y in LEFTWARD]
    found = joint(second=shifted)
    np.testing.assert_allclose([found.min_ade, found.min_fde], 0.5)


def test_states_that_are_not_recorded_are_left_out():
    tracks = two_tracks()
    tracks.valid[1, 2] = False
    off = [[-2, 0], [-99, 9], [-4, 0], [-5, 0]]
    found = joint(second=off, tracks=tracks)
    assert found.min_ade == 0.0 and found.miss == 0.0
    tracks.valid[1, 4] = False
    found = joint(second=off, tracks=tracks)
    assert np.isnan([found.min_fde, found.miss]).all() and found.samples == ()
    assert mean_precision(found) == 0.0


def test_overlap_is_that_of_the_most_probable_mode():
    apart, onto = [[20, 4], [20, 6], [20, 8], [20, 10]], [[-2, 0.5], [-3, 0.5], [-4, 0.5], [-5, 0.5]]
    modes, horizon = np.array([[apart], [onto]], dtype=np.float64), CHALLENGE.horizons[0]
    for confidences, overlap in (([0.9, 0.1], 0.0), ([0.1, 0.9], 1.0)):
        found = measure(two_tracks(), 0, (0,), modes, np.array(confidences), horizon, CHALLENGE)
        assert found.overlap == overlap


def test_further_matches_are_wrong_or_left_out():
    """Hard precision counts a second match as wrong; soft precision ignores it."""
    modes = np.array([[DIAGONAL], [DIAGONAL], [[[0, 0]] * 4]], dtype=np.float64)
    found = measure(two_tracks(), 0, (0,), modes, np.array([0.5, 0.9, 0.95]), CHALLENGE.horizons[0], CHALLENGE)
    assert found.samples == ((0.95, False), (0.9, True), (0.5, True))
    assert mean_precision(found) == mean_precision(found, is_soft=True) == 0.5
    other = measure(two_tracks(), 0, (0,), modes[1:], np.array([0.4, 0.8]), CHALLENGE.horizons[0], CHALLENGE)
    # By confidence: no, yes, no (a second match), no, yes of 2 (the last one at 0.4).
    assert mean_precision(found, other) == pytest.approx(0.5 * 0.5 + 0.5 * 0.4)
    assert mean_precision(found, other, is_soft=True) == pytest.approx(0.5 * 0.5 + 0.5 * 0.5)


def arc(turn, length, speed=8.0):
    """A track that turns at a constant rate."""
    heading = np.linspace(0, turn, 30)
    step = length / 29 * np.column_stack([np.cos(heading), np.sin(heading)])
    position = np.concatenate([[[0.0, 0.0]], np.cumsum(step, axis=0)[:-1]])
    return make_tracks(
        ["a"],
        np.array([1]),
        np.append(position, np.zeros((30, 1)), axis=1)[None],
        heading[None],
        speed * np.column_stack([np.cos(heading), np.sin(heading)])[None],
        np.ones((1, 30, 3)),
        np.ones((1, 30), bool),
        origin=np.zeros(3),
    )


@pytest.mark.parametrize(
    ("turn", "length", "speed", "shape"),
    [
        (0.0, 1.0, 0.5, STATIONARY),
        (0.0, 20.0, 8.0, STRAIGHT),
        (0.4, 30.0, 8.0, STRAIGHT_LEFT),
        (-0.4, 30.0, 8.0, STRAIGHT_RIGHT),
        (1.5, 20.0, 8.0, LEFT_TURN),
        (-1.5, 20.0, 8.0, RIGHT_TURN),
        (3.5, 20.0, 8.0, LEFT_U_TURN),
    ],
)
def test_shapes_of_trajectories(turn, length, speed, shape):
    assert trajectory_shape(arc(turn, length, speed), 0, 0) == shape
