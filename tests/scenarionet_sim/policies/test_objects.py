"""Selections of objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_sim.policies.objects import vehicles_behind_ego
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


def test_vehicles_behind_the_ego():
    """The ego starts at 0 m towards +x; each of the others misses one condition, but the first."""
    others = (
        Other(-10.0, vx=8.0),
        Other(10.0, vx=8.0),  # ahead
        Other(-0.5, 3.5, vx=8.0),  # beside
        Other(-10.0, 14.9, vx=8.0),
        Other(-10.0, -15.1, vx=8.0),  # too far aside
        Other(-10.0, 3.5, vx=1.0),  # ends within 5 m
        Other(-40.0, vx=8.0, first=20),  # far behind when it appears
    )
    scenario = make_drive("d", speed=10.0, others=others)
    expected = [False, True, False, False, True, False, False, True]
    assert vehicles_behind_ego(World.from_scenario(scenario)).tolist() == expected
    turned = scenario.tracks.heading.copy()
    turned[1] += np.pi
    against = replace(scenario, tracks=replace(scenario.tracks, heading=turned))
    assert vehicles_behind_ego(World.from_scenario(against)).tolist() == [False, False, *expected[2:]]
