"""Validation of actions."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import checked_actions


def test_actions_out_of_range_are_clipped():
    checked = checked_actions([[1e300, -np.inf], [0.25, -2.0]])
    np.testing.assert_array_equal(checked, [[1.0, -1.0], [0.25, -1.0]])


def test_single_action_needs_no_agent_dimension():
    assert checked_actions([0.5, 0.0]).shape == (1, 2)


def test_nan_action_is_rejected():
    with pytest.raises(BadParameter, match=r"not a number: \[nan, 0.0\]"):
        checked_actions([[0.0, 0.0], [np.nan, 0.0]])
