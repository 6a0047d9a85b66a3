"""Repeated conversion: which files are planned, skipped, replaced or refused, with buckets and with a limit."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake
from scenarionet_data.conversion import plan_conversion
from scenarionet_data.errors import DuplicateScenario, LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.lakes import content
from tests.fixtures.made import BUCKETED, FEW, NAME, NEWER, Made, MadeOptions, ids, run, wanted, write_raw
from tests.fixtures.schema_versions import raise_version


def test_second_run_skips_and_adds_new_files(raw, root):
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


def test_changed_file_is_refused_or_replaced(raw, root):
    write_raw(raw, {"a": [1, 2], "b": [3]})
    run(raw, root)
    write_raw(raw, {"a": [1, 5]})
    with pytest.raises(DuplicateScenario, match=r"a\.made is in the lake already, converted and has changed since"):
        run(raw, root)
    assert ids(root) == wanted(1, 2, 3)
    report = run(raw, root, replace=True)
    assert (report.converted, report.replaced, report.skipped) == (2, 1, 1)
    assert ids(root) == wanted(1, 3, 5)


def test_other_options_are_refused_replaced_or_kept_apart(raw, root):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    more = MadeOptions(num_objects=4)
    with pytest.raises(DuplicateScenario, match=r"replace=True .*another version"):
        run(raw, root, options=more)
    run(raw, root, options=more, version="v2")
    assert run(raw, root, options=more, replace=True).replaced == 1
    found = Lake(root).sql("SELECT version, tracks_num_rows FROM metadata ORDER BY 1").rows()
    assert found == [("v1", 4), ("v2", 4)]


def test_replacing_with_equal_content_skips(raw, root):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    assert run(raw, root, replace=True).skipped == 1


@pytest.mark.long
def test_newer_converter_replaces_only_on_request(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    report = run(raw, root, NEWER)
    assert (report.converted, report.skipped, report.stale) == (0, 2, 2)
    report = run(raw, root, NEWER, reconvert_stale=True)
    assert (report.converted, report.replaced) == (2, 2)
    versions = Lake(root).sql("SELECT DISTINCT converter_version AS v FROM metadata")["v"].to_list()
    assert versions == ["2"]
    assert ids(root) == wanted(1, 2)
    assert run(raw, root, NEWER, replace=True).skipped == 2


def test_another_schema_version_is_refused_until_replaced(raw, root, monkeypatch):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    old = tables.load("tracks").tag
    new = raise_version(monkeypatch, "tracks", is_compatible=False).tag
    with pytest.raises(
        LakeError, match=rf"shard a was written under .*{old}, this version reads .*{new}; .*replace=True"
    ):
        ids(root)
    with pytest.raises(DuplicateScenario, match="under another version of the contract"):
        run(raw, root)
    assert run(raw, root, replace=True).replaced == 1
    assert ids(root) == wanted(1)


def test_same_recordings_under_another_split_are_duplicates(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    write_raw(raw, {"c": [3]})
    report = run(raw, root, split="val")
    assert (report.converted, report.quarantined, report.duplicates, report.failed) == (1, 2, 2, [])
    assert ids(root) == wanted(1, 2, 3)
    again = run(raw, root, split="val")
    assert (again.skipped, again.converted, again.duplicates) == (3, 0, 0)


def test_older_readable_schema_is_kept_until_stale_shards_are_replaced(raw, root, monkeypatch):
    write_raw(raw, {"a": [1]})
    run(raw, root)
    raise_version(monkeypatch, "tracks")
    assert ids(root) == wanted(1)
    report = run(raw, root)
    assert (report.converted, report.skipped, report.stale) == (0, 1, 1)
    assert run(raw, root, reconvert_stale=True).replaced == 1
    assert ids(root) == wanted(1)


def test_planning_writes_nothing(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    plan = plan_conversion(NAME, str(raw), root, options=FEW)
    assert [shard.name for shard in plan.shards] == ["a", "b"]
    assert not root.exists()


# --- buckets ------------------------------------------------------------------------------------------


def files_of(*seeds):
    return {f"f{seed}": [seed] for seed in seeds}


@pytest.mark.long
def test_growing_buckets_keep_existing_shards(raw, root):
    write_raw(raw, files_of(*range(3)))
    run(raw, root, BUCKETED)
    before = set(content(root))
    write_raw(raw, files_of(*range(9)))
    report = run(raw, root, BUCKETED)
    assert report.converted == 6
    assert ids(root) == wanted(*range(9))
    assert before <= set(content(root))
    assert run(raw, root, BUCKETED).converted == 0


@pytest.mark.long
def test_bucket_with_a_changed_file_is_replaced_whole(raw, root):
    write_raw(raw, files_of(*range(8)))
    run(raw, root, BUCKETED)
    write_raw(raw, {"f3": [30]})
    with pytest.raises(DuplicateScenario, match=r"f3\.made .*has changed since"):
        run(raw, root, BUCKETED)
    report = run(raw, root, BUCKETED, replace=True)
    assert report.replaced == 1
    assert 1 <= report.converted < 8
    assert ids(root) == wanted(0, 1, 2, 4, 5, 6, 7, 30)


def test_replacing_a_bucket_must_not_drop_its_other_files(raw, root):
    write_raw(raw, files_of(*range(4)))
    run(raw, root, BUCKETED)
    held = manifests.shards(LocalLakeFiles(root), snapshots.read(LocalLakeFiles(root)))
    pair = next(record.items for record in held if len(record.items) > 1)
    (raw / pair[0]).unlink()
    (raw / pair[1]).write_text("77")
    with pytest.raises(DuplicateScenario, match=f"would drop {pair[0]}, .*give the whole raw folder"):
        run(raw, root, BUCKETED, replace=True)
    assert ids(root) == wanted(*range(4))


@pytest.mark.long
def test_overlapping_stale_buckets_are_replaced_together(raw, root, monkeypatch):
    """Old and new buckets share files: an old bucket is removed only once all of its files are converted again."""
    write_raw(raw, files_of(*range(4)))
    run(raw, root, BUCKETED)
    old = {record.key for record in manifests.shards(LocalLakeFiles(root), snapshots.read(LocalLakeFiles(root)))}
    write_raw(raw, files_of(*range(9)))
    monkeypatch.setattr(Made, "version", "2")
    (raw / "f3.made").write_text("3 corrupt")  # its old bucket also holds 0 and 1; its new one only itself
    report = run(raw, root, BUCKETED, replace=True)
    assert sorted(reason.split(";")[-1] for _, reason in report.failed) == [
        " copy it again",
        *2 * [" fix those and run the same command again: this shard is finished and will be adopted"],
    ]
    assert report.converted == 5
    assert report.replaced == 1
    assert ids(root) == wanted(0, 1, 2, 3, 4, 5, 6, 7)
    (raw / "f3.made").write_text("3")
    report = run(raw, root, BUCKETED, replace=True)
    assert report.is_clean
    assert report.adopted == 2
    assert ids(root) == wanted(*range(9))
    now = manifests.shards(LocalLakeFiles(root), snapshots.read(LocalLakeFiles(root)))
    assert old.isdisjoint(record.key for record in now)
    assert {record.converter_version for record in now} == {"2"}


def test_refused_plan_replaces_nothing(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    run(raw, root)
    write_raw(raw, {"a": [1, 2]})
    report = run(raw, root, replace=True)
    assert [name for name, _ in report.failed] == ["a"]
    assert (report.converted, report.replaced) == (0, 0)
    assert ids(root) == wanted(1, 2)


# --- limit --------------------------------------------------------------------------------------------


def test_limit_stops_early_and_full_run_replaces_it(raw, root):
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


@pytest.mark.long
def test_completed_limited_lake_equals_a_full_one(raw, tmp_path):
    write_raw(raw, {"a": [1, 2, 3], "b": [4]})
    run(raw, tmp_path / "first", limit=2)
    run(raw, tmp_path / "first")
    run(raw, tmp_path / "second")
    assert content(tmp_path / "first") == content(tmp_path / "second")
