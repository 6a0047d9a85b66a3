"""Actions of agents."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.action_kernels import place_actions
from scenarionet_sim.backends.base import checked_actions

actions_of = st.lists(st.tuples(st.floats(), st.floats()), min_size=12, max_size=12)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(), st.floats()), max_size=4))
def test_actions_are_clipped_and_the_first_invalid_one_is_found(given_actions):
    actions = np.array(given_actions, np.float64).reshape(-1, 2)
    expected, invalid = np.clip(actions, -1.0, 1.0), np.flatnonzero((~np.isfinite(actions)).any(axis=1)).tolist()
    if invalid:
        with pytest.raises(BadParameter, match=re.escape(str(given_actions[invalid[0]][0]))):
            checked_actions(actions)
    else:
        np.testing.assert_array_equal(checked_actions(actions), expected)


@settings(max_examples=60, deadline=None)
@given(actions_of, st.lists(st.booleans(), min_size=15, max_size=15), st.sampled_from([2, 4]))
def test_actions_of_seats_reach_the_agents_at_their_places(given_actions, is_free, num_seats):
    """3 worlds of 5 places, of which the first ones have seats; actions of free seats do not matter."""
    rows = np.where(np.reshape(is_free, (3, 5)), -1, 7).astype(np.int32)
    given_rows = np.array(given_actions[: 3 * num_seats], np.float64)
    placed = np.full((15, 2), 7.0)
    invalid = place_actions(rows, given_rows, placed)
    wanted, used = np.zeros((3, 5, 2)), (rows >= 0)[:, :num_seats]
    wanted[:, :num_seats][used] = given_rows.reshape(3, num_seats, 2)[used]
    lost = np.flatnonzero(used.ravel() & (~np.isfinite(given_rows)).any(axis=1)).tolist()
    assert invalid == (lost[0] if lost else -1)
    if not lost:
        np.testing.assert_array_equal(placed, np.clip(wanted, -1.0, 1.0).reshape(15, 2))
