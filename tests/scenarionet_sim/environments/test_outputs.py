"""Arrays of steps that are used again."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_sim.environments.outputs import ScenarioIds

changes = st.lists(
    st.tuples(
        st.dictionaries(st.integers(0, 4), st.text(max_size=2), max_size=3), st.sampled_from(["", "array", "view"])
    ),
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(changes)
def test_kept_ids_do_not_change(steps):
    ids, wanted, kept = ScenarioIds(5), np.full(5, "", dtype=object), []
    for changed, keeps in steps:
        ids.change(list(changed), list(changed.values()))
        wanted[list(changed)] = list(changed.values())
        np.testing.assert_array_equal(ids.now, wanted)
        if keeps:
            kept.append((ids.now if keeps == "array" else ids.now[:], wanted.copy()))
    for found, expected in kept:
        np.testing.assert_array_equal(found, expected)
