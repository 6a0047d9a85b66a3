"""Conversion: what is planned, skipped, replaced, rejected; and that who runs it, or how often, changes nothing."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.conversion import Job, convert_shard, plan_conversion
from scenarionet_data.errors import BadParameter, DuplicateScenario, LakeError, SourceNotFound
from scenarionet_data.store import manifests
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.testing import differences
from tests.fixtures.lakes import content
from tests.fixtures.made import BUCKETED, NAME, NEWER, Made, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario

FEW = MadeOptions(num_objects=2)


@pytest.fixture
def raw(tmp_path):
    return tmp_path / "raw"


@pytest.fixture
def root(tmp_path):
    return tmp_path / "lake"


def run(raw, root, name=NAME, **how):
    return convert(name, str(raw), root, **({"options": FEW} | how))


def ids(root):
    return Lake(root).sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"].to_list()


def wanted(*seeds):
    return [f"made/v1/s{seed:06d}" for seed in sorted(seeds)]


# --- one run ------------------------------------------------------------------------------------------


def test_a_lake_holds_what_the_converter_gave(raw, root):
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


def test_bad_records_go_to_quarantine_and_the_shard_goes_on(raw, root):
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


def test_a_corrupt_shard_fails_alone_and_is_tried_again(raw, root):
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


def test_a_fault_of_the_converter_names_the_shard(raw, root, monkeypatch):
    write_raw(raw, {"a": [1], "b": [2]})

    def records(self, shard):
        if shard.name == "a":
            raise ZeroDivisionError("oops")
        yield "2"

    monkeypatch.setattr(Made, "records", records)
    report = run(raw, root)
    assert report.converted == 1
    assert report.failed == [("a", f"ZeroDivisionError: oops (while reading {raw})")]


def test_when_every_shard_fails_there_is_no_lake(raw, root):
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
def test_partitions_are_plain_words(raw, root, wrong):
    write_raw(raw, {"a": [1]})
    with pytest.raises(BadParameter, match="use letters, digits"):
        run(raw, root, **wrong)


def test_nothing_to_convert_is_said_at_once(raw, root):
    with pytest.raises(SourceNotFound, match="no such folder; give the folder with made recordings"):
        run(raw, root)
    with pytest.raises(SourceNotFound, match="did you mean"):
        convert("waimo", str(raw), root)
    assert not root.exists()


# --- again --------------------------------------------------------------------------------------------


def test_a_second_run_skips_and_a_new_file_is_added(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    before = content(root)
    report = run(raw, root)
    assert (report.converted, report.shards, report.skipped, report.snapshot) == (0, 0, 2, 1)
    assert content(root) == before
    write_raw(raw, {"c": [3]})
    report = run(raw, root)
    assert (report.converted, report.skipped) == (1, 2)
    assert ids(root) == wanted(1, 2, 3)


def test_a_changed_file_is_refused_or_replaced(raw, root):
    write_raw(raw, {"a": [1, 2], "b": [3]})
    run(raw, root)
    write_raw(raw, {"a": [1, 5]})
    with pytest.raises(DuplicateScenario, match=r"a\.made is in the lake already, converted and has changed since"):
        run(raw, root)
    assert ids(root) == wanted(1, 2, 3)
    report = run(raw, root, replace_old=True)
    assert (report.converted, report.replaced, report.skipped) == (2, 1, 1)
    assert ids(root) == wanted(1, 3, 5)


def test_other_options_are_refused_replaced_or_kept_apart(raw, root):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    more = MadeOptions(num_objects=4)
    with pytest.raises(DuplicateScenario, match=r"--replace .*--version"):
        run(raw, root, options=more)
    run(raw, root, options=more, version="v2")
    assert run(raw, root, options=more, replace_old=True).replaced == 1
    found = Lake(root).sql("SELECT version, tracks_num_rows FROM metadata ORDER BY 1").rows()
    assert found == [("v1", 4), ("v2", 4)]


def test_replacing_with_the_same_skips(raw, root):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    assert run(raw, root, replace_old=True).skipped == 1


def test_a_newer_converter_replaces_only_when_told(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    report = run(raw, root, NEWER)
    assert (report.converted, report.skipped, report.stale) == (0, 2, 2)
    report = run(raw, root, NEWER, stale=True)
    assert (report.converted, report.replaced) == (2, 2)
    versions = Lake(root).sql("SELECT DISTINCT converter_version AS v FROM metadata")["v"].to_list()
    assert versions == ["2"]
    assert ids(root) == wanted(1, 2)
    assert run(raw, root, NEWER, replace_old=True).skipped == 2


def test_another_contract_is_refused_until_replaced(raw, root, monkeypatch):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    tag = "scenarionet_data.tables.content_tag"
    monkeypatch.setattr(tag, lambda: "tracks/2")
    with pytest.raises(
        LakeError, match=r"shard a was written under .*tracks/1, this version reads tracks/2; .*--replace"
    ):
        ids(root)
    with pytest.raises(DuplicateScenario, match="under another version of the contract"):
        run(raw, root)
    assert run(raw, root, replace_old=True).replaced == 1
    assert ids(root) == wanted(1)


def test_the_same_recordings_under_another_split_are_duplicates(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    write_raw(raw, {"c": [3]})
    report = run(raw, root, split="val")
    assert report.converted == 1
    assert sorted(name for name, _ in report.failed) == ["a", "b"]
    assert all("is in the lake already, from another source or split" in reason for _, reason in report.failed)
    assert ids(root) == wanted(1, 2, 3)


def test_planning_writes_nothing(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    plan = plan_conversion(NAME, str(raw), root, options=FEW)
    assert [shard.name for shard in plan.shards] == ["a", "b"]
    assert not root.exists()


# --- buckets ------------------------------------------------------------------------------------------


def files_of(*seeds):
    return {f"f{seed}": [seed] for seed in seeds}


def test_buckets_that_grow_keep_what_is_there(raw, root):
    write_raw(raw, files_of(*range(3)))
    run(raw, root, BUCKETED)
    before = set(content(root))
    write_raw(raw, files_of(*range(9)))
    report = run(raw, root, BUCKETED)
    assert report.converted == 6
    assert ids(root) == wanted(*range(9))
    assert before <= set(content(root))
    assert run(raw, root, BUCKETED).converted == 0


def test_a_bucket_with_a_changed_file_is_replaced_whole(raw, root):
    write_raw(raw, files_of(*range(8)))
    run(raw, root, BUCKETED)
    write_raw(raw, {"f3": [30]})
    with pytest.raises(DuplicateScenario, match=r"f3\.made .*has changed since"):
        run(raw, root, BUCKETED)
    report = run(raw, root, BUCKETED, replace_old=True)
    assert report.replaced == 1
    assert 1 <= report.converted < 8
    assert ids(root) == wanted(0, 1, 2, 4, 5, 6, 7, 30)


def test_replacing_a_bucket_must_not_drop_its_other_files(raw, root):
    write_raw(raw, files_of(*range(4)))
    run(raw, root, BUCKETED)
    held = manifests.shards(LakeFiles(root), snapshots.read(LakeFiles(root)))
    pair = next(record.items for record in held if len(record.items) > 1)
    (raw / pair[0]).unlink()
    (raw / pair[1]).write_text("77")
    with pytest.raises(DuplicateScenario, match=f"would drop {pair[0]}, .*give the whole raw folder"):
        run(raw, root, BUCKETED, replace_old=True)
    assert ids(root) == wanted(*range(4))


def test_stale_buckets_that_have_grown_apart_go_together(raw, root, monkeypatch):
    """Old buckets and new ones share files: the old go only when all of theirs are converted anew."""
    write_raw(raw, files_of(*range(4)))
    run(raw, root, BUCKETED)
    old = {record.key for record in manifests.shards(LakeFiles(root), snapshots.read(LakeFiles(root)))}
    write_raw(raw, files_of(*range(9)))
    monkeypatch.setattr(Made, "version", "2")
    (raw / "f3.made").write_text("3 corrupt")  # its old bucket holds 0 and 1 too, its new one itself alone
    report = run(raw, root, BUCKETED, replace_old=True)
    assert sorted(reason.split(";")[-1] for _, reason in report.failed) == [
        " copy it again",
        *2 * [" mend those and run the same command again: it is finished and will be adopted"],
    ]
    assert report.converted == 5
    assert report.replaced == 1
    assert ids(root) == wanted(0, 1, 2, 3, 4, 5, 6, 7)
    (raw / "f3.made").write_text("3")
    report = run(raw, root, BUCKETED, replace_old=True)
    assert report.is_clean
    assert report.adopted == 2
    assert ids(root) == wanted(*range(9))
    now = manifests.shards(LakeFiles(root), snapshots.read(LakeFiles(root)))
    assert old.isdisjoint(record.key for record in now)
    assert {record.converter_version for record in now} == {"2"}


def test_what_is_refused_replaces_nothing(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    write_raw(raw, {"a": [1, 2]})
    report = run(raw, root, replace_old=True)
    assert [name for name, _ in report.failed] == ["a"]
    assert (report.converted, report.replaced) == (0, 0)
    assert ids(root) == wanted(1, 2)


# --- limit --------------------------------------------------------------------------------------------


def test_a_limit_stops_early_and_the_whole_replaces_it(raw, root):
    write_raw(raw, {"a": [1, 2, 3], "b": [4, 5, 6], "c": [7]})
    assert run(raw, root, limit=4).converted == 4
    assert ids(root) == wanted(1, 2, 3, 4)
    assert run(raw, root, limit=4).converted == 4
    assert ids(root) == wanted(1, 2, 3, 4)
    assert run(raw, root, limit=2).converted == 2
    assert ids(root) == wanted(1, 2, 4)
    report = run(raw, root)
    assert (report.converted, report.replaced) == (7, 2)
    assert ids(root) == wanted(*range(1, 8))
    assert run(raw, root, limit=2).skipped == 3
    assert ids(root) == wanted(*range(1, 8))


def test_a_limited_lake_completed_equals_a_whole_one(raw, tmp_path):
    write_raw(raw, {"a": [1, 2, 3], "b": [4]})
    run(raw, tmp_path / "first", limit=2)
    run(raw, tmp_path / "first")
    run(raw, tmp_path / "second")
    assert content(tmp_path / "first") == content(tmp_path / "second")


# --- who runs it --------------------------------------------------------------------------------------


@pytest.mark.long
def test_workers_and_interruptions_change_nothing(raw, tmp_path):
    """One process, two, a run that ends half-way and goes on: the same files."""
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
        run(raw, tmp_path / "three", run=lambda jobs, do, lost: until(jobs, do, 3))
    assert len(ids(tmp_path / "three")) >= 7
    report = run(raw, tmp_path / "three")
    assert report.skipped == 3
    assert content(tmp_path / "one") == content(tmp_path / "two") == content(tmp_path / "three")


def test_finished_shards_are_adopted(raw, root):
    """A job that was killed between finishing a shard and committing it."""
    write_raw(raw, {"a": [1], "b": [2]})
    plan = plan_conversion(NAME, str(raw), root, options=FEW)
    finished = convert_shard(Job(NAME, plan.shards[0], str(root)))
    assert finished.record.num_scenarios == 1
    report = run(raw, root)
    assert (report.adopted, report.shards, report.converted) == (1, 2, 2)
    assert ids(root) == wanted(1, 2)


def test_many_shards_give_few_metadata_files_whatever_the_order(raw, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarionet_data.store.metadata_files.MAX_METADATA_FILES", 4)
    monkeypatch.setattr("scenarionet_data.store.metadata_files.MERGED_FILES", 2)
    write_raw(raw, {f"s{k}": [k] for k in range(4, 9)})
    run(raw, tmp_path / "parts")
    write_raw(raw, {f"s{k}": [k] for k in range(4)})
    run(raw, tmp_path / "parts")
    run(raw, tmp_path / "whole")
    assert content(tmp_path / "parts") == content(tmp_path / "whole")
    assert len(Lake(tmp_path / "parts").paths("metadata")) <= 2
    assert ids(tmp_path / "parts") == wanted(*range(9))


def test_long_jobs_commit_now_and_then(raw, root, monkeypatch):
    monkeypatch.setattr("scenarionet_data.conversion.basket._COMMIT_EVERY", 0.0)
    write_raw(raw, {"a": [1], "b": [2], "c": [3]})
    seen = []
    run(raw, root, on_progress=lambda done, *_: done and seen.append(len(Lake(root))))
    assert seen == [1, 2, 3]


def test_jobs_travel_to_workers(raw, root):
    write_raw(raw, {"a": [1]})
    (shard,) = plan_conversion(NAME, str(raw), root, options=FEW).shards
    job = Job(NAME, shard, str(root), 3)
    assert pickle.loads(pickle.dumps(job)) == job
    outcome = convert_shard(replace(job, max_scenarios=None))
    assert pickle.loads(pickle.dumps(outcome)) == outcome
