"""Scenarios found in the metadata files are those that SQL finds, with the same rows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import ScenarioNotFound
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

COUNT = 24


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Three metadata files."""
    root = tmp_path_factory.mktemp("rows")
    for part in range(3):
        write_lake(root, [make_scenario(seed) for seed in range(8 * part, 8 * part + 8)], name=f"part{part}")
    return Lake(root)


def rows_by_sql(lake, ids):
    return lake.resolve(ids)[1].drop_columns(["is_found"]).to_pylist()


def some_ids(count):
    return [make_scenario(int(seed)).id for seed in np.random.default_rng(count).integers(0, COUNT, count)]


@pytest.mark.parametrize("count", [1, 2, 50])
def test_ids_in_any_order_and_repeated(lake, count):
    ids = some_ids(count)
    _, found = lake.find(iter(ids))
    assert found.scenario_ids == ids
    assert list(found) == rows_by_sql(lake, ids)


def test_the_whole_lake_is_ordered_by_id(lake):
    _, found = lake.find(None)
    assert found.scenario_ids == sorted(make_scenario(seed).id for seed in range(COUNT))
    assert [row["scenario_id"] for row in found] == found.scenario_ids


def test_rows_survive_pickling(lake):
    _, found = lake.find(None)
    _ = found[3]
    assert list(pickle.loads(pickle.dumps(found))) == list(found)


def test_a_restricted_view_has_its_scenarios_only(lake):
    chosen = sorted(set(some_ids(5)))
    view = lake.restrict_to(chosen)
    assert view.find(None)[1].scenario_ids == chosen
    other = next(make_scenario(seed).id for seed in range(COUNT) if make_scenario(seed).id not in chosen)
    with pytest.raises(ScenarioNotFound, match=f"no scenario {other}"):
        view.find([chosen[0], other])


def test_missing_scenarios_are_counted(lake):
    known = make_scenario(0).id
    for ids in (["made/v1/x"], ["made/v1/x", known], ["made/v1/x", *[known] * 30]):
        with pytest.raises(ScenarioNotFound, match=f"no scenario made/v1/x in snapshot 3; 1 of {len(ids)} are missing"):
            lake.find(ids)
