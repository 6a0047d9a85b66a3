"""Validation of actions."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import checked_actions


def test_actions_out_of_range_are_clipped():
    checked = checked_actions([[1e300, -1e300], [0.25, -2.0]])
    np.testing.assert_array_equal(checked, [[1.0, -1.0], [0.25, -1.0]])


def test_single_action_needs_no_agent_dimension():
    assert checked_actions([0.5, 0.0]).shape == (1, 2)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_action_that_is_not_finite_is_rejected(value):
    with pytest.raises(BadParameter, match=rf"not finite: \[{value}, 0.0\]"):
        checked_actions([[0.0, 0.0], [value, 0.0]])
