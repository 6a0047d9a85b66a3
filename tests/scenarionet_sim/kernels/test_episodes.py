"""Agents in lists of agents, and their actions."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_sim.agents import places
from scenarionet_sim.kernels.actions import clip_actions

agent_lists = st.sets(st.tuples(st.integers(0, 3), st.integers(0, 5)), max_size=12).map(sorted)


@settings(max_examples=60, deadline=None)
@given(agent_lists, agent_lists)
def test_agents_are_found_in_other_lists(rows, others):
    found = places(*(np.array(agents, np.int32).reshape(-1, 2) for agents in (rows, others)))
    assert found.tolist() == [others.index(agent) if agent in others else -1 for agent in rows]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(), st.floats()), max_size=4))
def test_actions_are_clipped_and_the_first_invalid_one_is_found(given_actions):
    actions = np.array(given_actions, np.float64).reshape(-1, 2)
    expected, invalid = np.clip(actions, -1.0, 1.0), np.flatnonzero(np.isnan(actions).any(axis=1)).tolist()
    assert clip_actions(actions) == (invalid[0] if invalid else -1)
    np.testing.assert_array_equal(actions, expected)
