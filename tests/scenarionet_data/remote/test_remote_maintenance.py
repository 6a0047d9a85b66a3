"""Maintenance of a lake in an object store: the same compaction, vacuum and fsck as in a folder."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake, ScenarioLoader, maintenance
from scenarionet_data.storage.files import remote
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.testing import differences
from tests.fixtures.lakes import write_lake, write_shard
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.long

MADE = [make_scenario(seed, num_objects=4, num_steps=11) for seed in range(4)]


@pytest.fixture
def lake(url):
    for k, scenario in enumerate(MADE):
        lake = write_lake(url, [scenario], name=f"shard{k}")
    return lake


def test_compacted_scenarios_are_equal(lake, url):
    lake.filter("num_objects > 0", name="all")
    assert maintenance.compact(url, "analytics").snapshot > lake.snapshot.number
    assert len(Lake(url).paths("tracks")) == 1
    assert [differences(a, b) for a, b in zip(ScenarioLoader(url, "all"), MADE, strict=True)] == [[]] * 4
    assert maintenance.fsck(url, is_deep=True).is_whole


def test_expired_snapshots_are_removed(lake, url):
    done = maintenance.vacuum(url, keep_last=1)
    assert done.expired == (1, 2, 3)
    assert open_files(url).names("snapshots", ".json") == ["snapshots/00000004.json"]
    assert len(list(ScenarioLoader(url))) == 4


def test_damaged_file_is_found_and_removed(lake, url):
    name = lake.paths("tracks")[0].removeprefix(f"{url}/")
    open_files(url)._store.put(name, b"something else")
    found = maintenance.fsck(url)
    assert [problem.file for problem in found.problems] == [name]
    assert len(maintenance.repair(url, found)) == 1
    assert len(Lake(url)) == 3


def test_files_past_the_grace_period_are_written_again(url, monkeypatch):
    files = open_files(url)
    record = write_shard(url, MADE[:1])
    before = {each.name: each.modified for each in files.listing("tracks")}
    monkeypatch.setattr(remote, "_YOUNG", -2.0)  # every existing file counts as old
    commits.commit(files, [record], "test")
    after = {each.name: each.modified for each in files.listing("tracks")}
    assert list(after) == list(before)
    assert all(after[name] >= before[name] for name in after)
    assert files.renew(["tracks/none-0000000000000000.parquet"]) == ["tracks/none-0000000000000000.parquet"]
    assert differences(ScenarioLoader(url)[0], MADE[0]) == []


def test_shared_row_group_is_fetched_once(lake, url, store):
    maintenance.compact(url, "analytics")
    loader = ScenarioLoader(url)
    loader.batch(range(4))
    store.set()
    assert [differences(a, b) for a, b in zip(loader.batch(range(4)), MADE, strict=True)] == [[]] * 4
    assert len(store.requests()) <= 3
