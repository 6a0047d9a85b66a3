"""Tests of a driver: every agent counts once, whatever the others do; without torch."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import LakeError
from scenarionet_sim.environments.config import MultiAgentConfig, VectorConfig
from scenarionet_sim.learning.testing import drive_each


def coasts(observations):
    return np.zeros((len(observations), 2), np.float32)


def speeds(observations):
    return np.tile(np.float32([0.0, 1.0]), (len(observations), 1))


def test_all_drivers_are_tested_on_the_same_agents(only):
    crowd = MultiAgentConfig(only("crowd"), prefetch=0)
    assert drive_each(crowd, coasts, 1, 13).episodes == drive_each(crowd, speeds, 1, 13).episodes == 13
    with pytest.raises(LakeError, match=r"13 agents drove and .* had a seat; expected a seat for each"):
        drive_each(crowd, coasts, 1, 3)


def test_drivers_that_crash_are_counted(only):
    """One of two scenarios has a wall 25 m ahead."""
    found = drive_each(VectorConfig(only("wall", "empty"), prefetch=0), speeds, 2).take()
    assert found["episodes"] == 2 and found["crashed"] == 0.5
    assert found["final_distance"] > found["distance_to_log"] > 1.0
