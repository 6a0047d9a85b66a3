"""Results of one conversion run, independent of the number of workers and of interruptions."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.conversion import ShardJob, convert_shard, plan_conversion
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.testing import differences
from tests.fixtures.lakes import content
from tests.fixtures.made import FEW, NAME, Made, ids, run, wanted, write_raw
from tests.fixtures.scenarios import make_scenario


def test_lake_holds_converted_scenarios(raw, root):
    write_raw(raw, {"a": [1, 2], "b": [3]})
    seen = []
    report = run(raw, root, on_progress=lambda *counts: seen.append(counts))
    assert (report.converted, report.shards, report.skipped, report.quarantined) == (3, 2, 0, 0)
    assert report.is_clean
    assert report.snapshot == 1
    assert report.partitions == {("made", "v1", "train")}
    assert report.size > 0
    assert seen == [(0, 2, 0), (1, 2, 2), (2, 2, 3)]
    for scenario in ScenarioLoader(root):
        seed = int(scenario.source.scenario_id[1:])
        assert differences(scenario, make_scenario(seed, num_objects=2)) == []


def test_bad_records_are_quarantined_and_the_shard_continues(raw, root):
    write_raw(raw, {"a": [1, "2 invalid", "3 bug", 4, 1]})
    report = run(raw, root)
    assert (report.converted, report.quarantined, report.failed) == (2, 3, [])
    assert not report.is_clean
    assert ids(root) == wanted(1, 4)
    rows = Lake(root).sql("SELECT shard, position, scenario_id, error, field FROM quarantine ORDER BY position")
    assert rows.rows() == [
        ("a", 1, "made/v1/s000002", "InvalidScenario", "dt"),
        ("a", 2, None, "IndexError", None),
        ("a", 4, "made/v1/s000001", "InvalidScenario", "id"),
    ]


def test_corrupt_shard_fails_alone_and_is_retried(raw, root):
    write_raw(raw, {"a": [1, "2 corrupt"], "b": [3]})
    report = run(raw, root)
    assert report.converted == 1
    ((name, reason),) = report.failed
    assert name == "a"
    assert "corrupt; copy it again" in reason
    assert ids(root) == wanted(3)
    assert not list((root / ".tmp").iterdir())
    write_raw(raw, {"a": [1, 2]})
    assert run(raw, root).converted == 2
    assert ids(root) == wanted(1, 2, 3)


def test_converter_bug_names_the_shard(raw, root, monkeypatch):
    write_raw(raw, {"a": [1], "b": [2]})

    def records(self, shard):
        if shard.name == "a":
            raise ZeroDivisionError("oops")
        yield "2"

    monkeypatch.setattr(Made, "records", records)
    report = run(raw, root)
    assert report.converted == 1
    assert report.failed == [("a", f"ZeroDivisionError: oops (while reading {raw})")]


def test_no_lake_is_created_when_every_shard_fails(raw, root):
    write_raw(raw, {"a": ["1 corrupt"]})
    report = run(raw, root)
    assert (report.converted, report.snapshot, len(report.failed)) == (0, 0, 1)


def test_split_and_version_name_the_partition(tmp_path, root):
    raw = write_raw(tmp_path / "validation", {"a": [1]})
    run(raw, root)
    run(raw, root, version="v2")
    run(write_raw(tmp_path / "other", {"a": [2]}), root, split="night")
    found = Lake(root).sql("SELECT version, split, count(*) FROM metadata GROUP BY ALL ORDER BY ALL").rows()
    assert found == [("v1", "night", 1), ("v1", "val", 1), ("v2", "val", 1)]


@pytest.mark.parametrize("wrong", [{"split": "a/b"}, {"version": "v 1"}, {"split": "ü"}])
def test_invalid_partition_names_are_refused(raw, root, wrong):
    write_raw(raw, {"a": [1]})
    with pytest.raises(BadParameter, match="use letters, digits"):
        run(raw, root, **wrong)


def test_error_when_nothing_to_convert(raw, root):
    with pytest.raises(SourceNotFound, match="no such folder; give the folder with made recordings"):
        run(raw, root)
    with pytest.raises(SourceNotFound, match="did you mean"):
        convert("waimo", str(raw), root)
    assert not root.exists()


# --- execution ----------------------------------------------------------------------------------------


@pytest.mark.long
def test_workers_and_interruptions_do_not_change_files(raw, tmp_path):
    """One process, two processes, and an interrupted and resumed run write the same files."""
    lines = {f"s{k}": [k * 10 + i for i in range(3)] for k in range(5)}
    write_raw(raw, {**lines, "bad": ["98 invalid", 99]})
    whole = run(raw, tmp_path / "one")
    assert whole.quarantined == 1
    assert run(raw, tmp_path / "two", workers=2).converted == whole.converted == 16

    def until(jobs, do, stop):
        for done, job in enumerate(jobs):
            if done == stop:
                raise KeyboardInterrupt
            yield do(job)

    with pytest.raises(KeyboardInterrupt):
        run(raw, tmp_path / "three", executor=lambda jobs, do, lost: until(jobs, do, 3))
    assert len(ids(tmp_path / "three")) >= 7
    report = run(raw, tmp_path / "three")
    assert report.skipped == 3
    assert content(tmp_path / "one") == content(tmp_path / "two") == content(tmp_path / "three")


def test_finished_shards_are_reused(raw, root):
    """The job was killed between finishing a shard and committing it."""
    write_raw(raw, {"a": [1], "b": [2]})
    plan = plan_conversion(NAME, str(raw), root, options=FEW)
    finished = convert_shard(ShardJob(NAME, plan.shards[0], str(root)))
    assert finished.record.num_scenarios == 1
    report = run(raw, root)
    assert (report.adopted, report.shards, report.converted) == (1, 2, 2)
    assert ids(root) == wanted(1, 2)


@pytest.mark.long
def test_many_shards_give_few_metadata_files_in_any_order(raw, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarionet_data.storage.snapshots.metadata_files.MAX_METADATA_FILES", 4)
    monkeypatch.setattr("scenarionet_data.storage.snapshots.metadata_files.MERGED_FILES", 2)
    write_raw(raw, {f"s{k}": [k] for k in range(4, 9)})
    run(raw, tmp_path / "parts")
    write_raw(raw, {f"s{k}": [k] for k in range(4)})
    run(raw, tmp_path / "parts")
    run(raw, tmp_path / "whole")
    assert content(tmp_path / "parts") == content(tmp_path / "whole")
    assert len(Lake(tmp_path / "parts").paths("metadata")) <= 2
    assert ids(tmp_path / "parts") == wanted(*range(9))


def test_long_jobs_commit_periodically(raw, root, monkeypatch):
    monkeypatch.setattr("scenarionet_data.conversion.committer._COMMIT_EVERY", 0.0)
    write_raw(raw, {"a": [1], "b": [2], "c": [3]})
    seen = []
    run(raw, root, on_progress=lambda done, *_: done and seen.append(len(Lake(root))))
    assert seen == [1, 2, 3]


def test_jobs_are_picklable(raw, root):
    write_raw(raw, {"a": [1]})
    (shard,) = plan_conversion(NAME, str(raw), root, options=FEW).shards
    job = ShardJob(NAME, shard, str(root), 3)
    assert pickle.loads(pickle.dumps(job)) == job
    outcome = convert_shard(replace(job, max_scenarios=None))
    assert pickle.loads(pickle.dumps(outcome)) == outcome
