"""Pairs are formed only of the objects that are left, and the answer is that of all pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.operations.moments import relation
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import along, moment

FAST = relation("has_velocity", {"min_velocity": 2.0})
SLOW = relation("has_velocity", {"max_velocity": 3.0}).reversed()
NEAR = relation("near_objects", {"distance_thresh": 12.0})
CROWDED = relation("near_objects", {"distance_thresh": 12.0, "min_objects": 2})
NEXT = relation("has_objects_in_relative_direction", {"max_number": 1})
CROSSED = relation("being_crossed_by")
TOWARD = relation("heading_toward")
AROUND = relation("facing_toward", {"within_angle": 180.0})


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Ten objects that start anywhere on 60 by 60 m, and move anywhere with 0 to 6 m/s."""
    rng = np.random.default_rng(0)
    movers = {f"o{k}": along(*rng.uniform(-30, 30, 2), *rng.uniform(-4, 4, 2)) for k in range(9)}
    return write_lake(tmp_path_factory.mktemp("pairs"), [moment("random", along(0, 0, 3), **movers)])


def in_full(steps):
    return replace(steps, narrows=())


@pytest.mark.integration
@pytest.mark.parametrize(
    "pair", [NEAR, CROWDED, NEXT, CROSSED, TOWARD], ids=["near", "crowded", "next", "crossed", "toward"]
)
@pytest.mark.parametrize("compose", [
    lambda pair: FAST & pair,
    lambda pair: pair & SLOW,
    lambda pair: FAST & SLOW & pair,
    lambda pair: FAST & SLOW & ~pair & AROUND,
    lambda pair: (pair & FAST) & (SLOW & TOWARD),
])  # fmt: skip
def test_narrowed_pairs_give_what_all_pairs_give(lake, pair, compose):
    narrowed, full = compose(pair), compose(in_full(pair))
    columns = "scenario_id, track_id, other_id, timestep"
    found = lake.sql(f"SELECT {columns} FROM ({narrowed.sql}) ORDER BY ALL").rows()
    assert len(found) > 3
    assert found == lake.sql(f"SELECT {columns} FROM ({full.sql}) ORDER BY ALL").rows()


def test_which_roles_are_narrowed():
    both = ("track_id", "other_id")
    assert [each.narrows for each in (NEAR, CROWDED, NEXT, CROSSED, TOWARD)] == [both, both[:1], both[:1], (), both]
    assert "SEMI JOIN" in (FAST & CROWDED).sql
    assert "SEMI JOIN" not in (SLOW & CROWDED).sql
