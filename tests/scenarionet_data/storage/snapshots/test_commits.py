"""Concurrent commits accumulate without losing any."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import SnapshotConflict
from scenarionet_data.maintenance.compaction import compact
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.maintenance.vacuuming import vacuum
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.write import layouts, rewriting
from tests.fixtures.lakes import stored_ids, write_shard
from tests.fixtures.scenarios import renamed, small
from tests.fixtures.waiting import HANGS_AFTER


def names_of(files):
    return [record.name for record in manifests.shards(files, snapshots.read(files))]


def test_commits_accumulate_and_old_snapshots_are_kept(files, template):
    for k in range(3):
        record = write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}")
        done = commits.commit(files, [record], f"step {k}")
        assert done.snapshot.number == k + 1
        assert done.snapshot.operation == f"step {k}"
    assert snapshots.numbers(files) == [1, 2, 3]
    assert len(stored_ids(files)) == 3
    assert len(snapshots.read(files, 1).metadata) == 1
    assert names_of(files) == ["shard0", "shard1", "shard2"]
    assert len(Lake(files.root, snapshot=2)) == 2


def test_committing_again_changes_nothing(files, template):
    record = write_shard(files.root, [template])
    first = commits.commit(files, [record], "test")
    assert commits.commit(files, [record], "test") == first
    assert commits.commit(files, [], "test") == first
    assert snapshots.numbers(files) == [1]


def test_duplicates_are_left_out_and_the_rest_committed(files, template):
    commits.commit(files, [write_shard(files.root, [template], name="old")], "test")
    again = write_shard(files.root, [renamed(template, "x"), template], name="again")
    twice = [write_shard(files.root, [renamed(template, "y")], name=name) for name in ("one", "two")]
    fresh = write_shard(files.root, [renamed(template, "z")], name="fresh")
    done = commits.commit(files, [again, *twice, fresh], "test")
    assert done.refused == ()
    assert [(old.name, old.num_scenarios, new.num_scenarios) for old, new in done.reduced] == [
        ("again", 2, 1),
        ("two", 1, 0),
    ]
    assert names_of(files) == ["again", "fresh", "old", "one", "two"]
    assert stored_ids(files) == sorted([template.id, *(f"made/v1/{name}" for name in "xyz")])
    quarantine = Lake(files.root).sql("SELECT shard, scenario_id, position, error, field, message FROM quarantine")
    rows = {row["shard"]: row for row in quarantine.to_dicts()}
    assert {(row["error"], row["field"]) for row in rows.values()} == {("DuplicateScenario", "id")}
    assert (rows["again"]["scenario_id"], rows["again"]["position"]) == (template.id, 1)
    assert "found it in split train, recording" in rows["again"]["message"] and "/old-000-" in rows["again"]["message"]
    assert "found it in split train, shard one" in rows["two"]["message"]
    assert commits.commit(files, [again, *twice, fresh], "test").snapshot == done.snapshot


def test_one_of_64_scenarios_is_left_out_and_the_others_are_unchanged(files, template):
    scenarios = [renamed(template, f"s{k}") for k in range(64)]
    commits.commit(files, [write_shard(files.root, [scenarios[40]], name="old")], "test")
    commits.commit(files, [write_shard(files.root, scenarios, name="new")], "test")
    loaded = {scenario.id: scenario for scenario in ScenarioLoader(files.root)}
    assert loaded.keys() == {scenario.id for scenario in scenarios}
    assert all(content_hash(loaded[scenario.id]) == content_hash(scenario) for scenario in scenarios)
    assert fsck(files.root, is_deep=True).problems == ()


def test_reduced_shard_is_written_once(files, template, monkeypatch):
    """A retry after another job's commit, or after a kill between writing and committing, uses what is there."""
    commits.commit(files, [write_shard(files.root, [template], name="old")], "test")
    again = write_shard(files.root, [renamed(template, "x"), template], name="again")
    with monkeypatch.context() as patched:
        patched.setattr(snapshots, "publish", killed)
        with pytest.raises(KeyboardInterrupt):
            commits.commit(files, [again], "test")
    present = {path: path.stat().st_ino for path in files.root.rglob("*.parquet")}
    commits.commit(files, [again], "test")
    tables = ("tracks", "maps", "metadata", "quarantine")
    now = {
        path: path.stat().st_ino
        for path in files.root.rglob("*.parquet")
        if path.relative_to(files.root).parts[0] in tables
    }
    assert now.items() <= present.items()
    assert stored_ids(files) == sorted([template.id, "made/v1/x"])


def killed(*_):
    raise KeyboardInterrupt


def test_of_two_jobs_with_the_same_scenario_one_has_it(files, template, monkeypatch):
    """Another job commits the scenario after this one has looked for it."""
    mine = write_shard(files.root, [renamed(template, "x"), template], name="mine")
    theirs = write_shard(files.root, [template, renamed(template, "y")], name="theirs")
    publish, calls = snapshots.publish, []

    def raced(*arguments):
        calls.append(1)
        if len(calls) == 1:
            commits.commit(files, [theirs], "test")
        return publish(*arguments)

    monkeypatch.setattr(snapshots, "publish", raced)
    done = commits.commit(files, [mine], "test")
    assert [(old.name, new.num_scenarios) for old, new in done.reduced] == [("mine", 1)]
    assert stored_ids(files) == sorted([template.id, "made/v1/x", "made/v1/y"])


def test_same_id_is_duplicate_in_other_split_but_not_in_other_version(files):
    commits.commit(files, [write_shard(files.root, [small(1)])], "test")
    other_split = write_shard(files.root, [small(1, split="val")], name="b")
    other_version = write_shard(files.root, [small(1, version="v2")], name="c")
    done = commits.commit(files, [other_split, other_version], "test")
    assert [old.name for old, _ in done.reduced] == ["b"]
    assert stored_ids(files) == ["made/v1/s000001", "made/v2/s000001"]


def test_replaced_shards_are_removed_from_newest_snapshot_only(files, template):
    old = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(3)]
    commits.commit(files, old, "test")
    new = write_shard(files.root, [renamed(template, "s1"), renamed(template, "s9")], name="new")
    commits.commit(files, [new], "test", frozenset([old[1].key]))
    assert stored_ids(files) == ["made/v1/s0", "made/v1/s1", "made/v1/s2", "made/v1/s9"]
    assert names_of(files) == ["new", "shard0", "shard2"]
    assert len(Lake(files.root, snapshot=1)) == 3


def test_refused_replacement_keeps_replaced_shards(files, template):
    old = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(2)]
    commits.commit(files, old, "test")
    new = write_shard(files.root, [renamed(template, "s0"), renamed(template, "s1")], name="new")
    done = commits.commit(files, [new], "test", frozenset([old[0].key]))
    assert [record.name for record, _ in done.refused] == ["new"]
    assert names_of(files) == ["shard0", "shard1"]
    assert snapshots.numbers(files) == [1]


def test_manifests_are_merged_after_many_commits(files, template, monkeypatch):
    monkeypatch.setattr(manifests, "_MAX_MANIFESTS", 3)
    for k in range(8):
        commits.commit(files, [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}")], "test")
        assert len(snapshots.read(files).manifests) <= 3
        assert names_of(files) == [f"shard{j}" for j in range(k + 1)]


def test_concurrent_threads_lose_no_commit(files, template):
    records = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(10)]
    threads = [threading.Thread(target=commits.commit, args=(files, [record], "test")) for record in records]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(stored_ids(files)) == 10
    assert len(names_of(files)) == 10
    numbers = snapshots.numbers(files)
    assert numbers == list(range(1, len(numbers) + 1))


COMMIT_MANY = """
import sys
from pathlib import Path
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.files.local import LocalLakeFiles
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import renamed, small
root, who = Path(sys.argv[1]), sys.argv[2]
template = small(1)
records = [write_shard(root, [renamed(template, f"{who}{k}")], name=f"{who}{k}") for k in range(12)]
print("ready", flush=True)
sys.stdin.readline()
for record in records:
    commits.commit(LocalLakeFiles(root), [record], who)
"""


@pytest.mark.long
def test_concurrent_processes_lose_no_commit(files):
    jobs = [
        subprocess.Popen(
            [sys.executable, "-c", COMMIT_MANY, str(files.root), who],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for who in ("a", "b")
    ]
    for job in jobs:
        assert job.stdout.readline() == "ready\n"
    for job in jobs:
        job.stdin.write("go\n")
        job.stdin.flush()
    for job in jobs:
        job.communicate(timeout=HANGS_AFTER)
        assert job.returncode == 0
    assert stored_ids(files) == sorted(f"made/v1/{who}{k}" for who in "ab" for k in range(12))
    assert snapshots.read(files).number == 24


def test_endless_conflicts_raise_error_with_remedy(files, template, monkeypatch):
    record = write_shard(files.root, [template])
    monkeypatch.setattr(snapshots, "publish", lambda files, snapshot: False)
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    with pytest.raises(SnapshotConflict, match="run the same command again, no work is lost"):
        commits.commit(files, [record], "test")


def test_commit_starts_again_when_a_vacuum_removed_files_of_its_base(files, template, monkeypatch):
    """Another job replaces a shard and a vacuum runs, after this commit has read the newest snapshot."""
    old = write_shard(files.root, [renamed(template, "s0")], name="old")
    commits.commit(files, [old], "test")
    mine = write_shard(files.root, [renamed(template, "s1")], name="mine")
    read, happened = snapshots.read, []

    def read_and_raced(*arguments):
        base = read(*arguments)
        if not happened:
            happened.append(base.number)
            new = write_shard(files.root, [renamed(template, "s0")], name="new")
            commits.commit(files, [new], "test", frozenset([old.key]))
            vacuum(files.root, keep_last=1)
            assert not any(files.has(name) for name in (*base.manifests, *base.metadata))
        return base

    monkeypatch.setattr(snapshots, "read", read_and_raced)
    done = commits.commit(files, [mine], "test")
    assert (happened, done.snapshot.number, done.refused, done.reduced) == ([1], 3, (), ())
    assert names_of(files) == ["mine", "new"]
    assert stored_ids(files) == ["made/v1/s0", "made/v1/s1"]


def test_commit_that_only_removes(files, template):
    records = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(3)]
    commits.commit(files, records, "test")
    done = commits.commit(files, [], "repair", frozenset([records[1].key]))
    assert (done.snapshot.number, done.snapshot.operation) == (2, "repair")
    assert names_of(files) == ["shard0", "shard2"]
    assert stored_ids(files) == ["made/v1/s0", "made/v1/s2"]
    assert commits.commit(files, [], "repair", frozenset([records[1].key])).snapshot.number == 2  # gone already


def test_rewritten_shards_that_another_job_has_replaced_are_late(files, template):
    old = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(2)]
    commits.commit(files, old, "test")
    layout = layouts.load("analytics")
    rewritten = [commits.Rewritten((each,), tuple(rewriting.rewrite(files, [each], layout))) for each in old]
    new = write_shard(files.root, [renamed(template, "s9")], name="new")
    commits.commit(files, [new], "test", frozenset([old[0].key]))
    snapshot, late = commits.replace_files(files, rewritten, "compact")
    assert (snapshot.number, late) == (3, rewritten[:1])
    current = {each.name: each for each in manifests.shards(files, snapshot)}
    assert current == {"new": new, "shard1": rewritten[1].new[0]}
    assert commits.replace_files(files, rewritten[:1], "compact") == (snapshot, rewritten[:1])
    assert stored_ids(files) == ["made/v1/s1", "made/v1/s9"]


def test_compaction_plans_shards_again_that_were_replaced_meanwhile(files, template):
    old = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(3)]
    commits.commit(files, old, "test")
    new, replaced = write_shard(files.root, [renamed(template, "s9")], name="new"), []

    def run(jobs, do, lost=None):
        yield from [do(job) for job in jobs]
        if not replaced:
            replaced.append(commits.commit(files, [new], "test", frozenset([old[0].key])))

    done = compact(files.root, "analytics", executor=run)
    assert (done.shards, done.left, done.failed) == (3, 0, [])
    assert len(Lake(files.root).paths("tracks")) == 1
    assert stored_ids(files) == ["made/v1/s1", "made/v1/s2", "made/v1/s9"]
