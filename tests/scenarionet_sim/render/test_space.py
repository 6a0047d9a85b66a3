"""Films: the ego's colour is the ego's alone."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.render.space import Film, recorded_moments
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive

EGO, FOLLOWER = 0, 1
AT_EGO, AT_FOLLOWER = np.s_[85:110, 175:225], np.s_[105:160, 125:195]
"""Pixels in a picture from behind the follower, who is in the lane to the left of the ego."""


@pytest.fixture(scope="module")
def world():
    return World.from_scenario(make_drive("seen", others=(Other(-12.0, 3.5, vx=10.0),)))


def orange(picture):
    red, green, blue = picture.astype(float).transpose(2, 0, 1)
    return (red > 1.6 * blue) & (red > 1.2 * green) & (red > 90) & (green > 0.5 * red)  # no tail lamps


def test_a_chased_vehicle_has_its_own_colour_and_the_ego_the_egos(world):
    moments = recorded_moments(world)[10:12]
    chased = orange(next(Film("chase", 320, 180).frames(world, moments, FOLLOWER)))
    assert chased[AT_EGO].sum() > 60
    assert chased[AT_FOLLOWER].sum() < 10
    own = orange(next(Film("chase", 320, 180).frames(world, moments)))
    assert own[AT_FOLLOWER].sum() > 1000
