"""vacuum: unreferenced files are removed, and nothing else, also while others read and write."""

from __future__ import annotations

import os
import pickle

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.conversion import plan_conversion
from scenarionet_data.conversion.jobs import ShardJob, convert_shard
from scenarionet_data.errors import BadParameter, LakeError, NoSuchSnapshot
from scenarionet_data.maintenance import compact, plan_vacuum, vacuum
from scenarionet_data.query.members import StaleDatabaseWarning
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from tests.fixtures.made import NAME, write_raw
from tests.scenarionet_data.maintenance.conftest import OPTIONS, age, check_whole, content, convert_to

pytestmark = pytest.mark.integration


@pytest.fixture
def compacted(root):
    """A lake of two snapshots that share no file of a table."""
    compact(root, "analytics")
    return root


def stored(root):
    """Every file of the lake's tables and snapshots."""
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}


# --- removed files --------------------------------------------------------------------------------------


def test_plan_lists_files_and_changes_nothing(compacted):
    before = stored(compacted)
    plan = plan_vacuum(compacted, keep_last=1)
    assert stored(compacted) == before
    assert (plan.expired, plan.kept, plan.needed, plan.young, plan.is_done) == ((1,), (2,), {}, (), False)
    counted = {table: number for table, (number, _) in plan.tables.items()}
    assert counted == {"tracks": 4, "lights": 4, "maps": 4, "metadata": 4, "snapshots": 1}
    assert plan.size == sum((compacted / listed.name).stat().st_size for listed in plan.files)


def test_files_referenced_only_by_expired_snapshots_are_removed(compacted):
    before, planned = content(Lake(compacted)), plan_vacuum(compacted, keep_last=1)
    done = vacuum(compacted, keep_last=1)
    assert (done.expired, done.files, done.is_done) == (planned.expired, planned.files, True)
    assert not {listed.name for listed in planned.files} & stored(compacted)
    assert snapshots.numbers(LocalLakeFiles(compacted)) == [2]
    assert content(Lake(compacted)) == before
    check_whole(compacted)
    again = vacuum(compacted, keep_last=1)
    assert (again.expired, again.files) == ((), ())


def test_files_shared_with_a_kept_snapshot_are_kept(raw, root):
    convert_to(write_raw(raw, {"new": [77]}), root)
    done = vacuum(root, keep_last=1)
    assert (done.expired, {listed.name.split("/")[0] for listed in done.files}) == ((1,), set())
    check_whole(root)


def test_sources_of_merged_metadata_are_kept(raw, root, monkeypatch):
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 2)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 2)
    convert_to(write_raw(raw, {"new": [77]}), root)
    vacuum(root, keep_last=1)
    write_raw(raw, {"new": [78]})  # falls back to the shards' own files
    convert_to(raw, root, replace=True)
    assert len(content(Lake(root))) == 9
    check_whole(root)


def test_keep_last_and_older_than_combine(raw, root):
    for seed in range(3):
        convert_to(write_raw(raw, {f"n{seed}": [70 + seed]}), root)
    for number, days in ((1, 40), (2, 20)):
        path = root / snapshots.file_name(number)
        os.utime(path, (path.stat().st_mtime - days * 86400,) * 2)
    assert plan_vacuum(root, older_than=30 * 86400).expired == (1,)
    assert plan_vacuum(root, older_than=10 * 86400).expired == (1, 2)
    assert plan_vacuum(root, older_than=0).expired == (1, 2, 3)
    assert plan_vacuum(root, keep_last=2).expired == (1, 2)
    assert plan_vacuum(root, keep_last=3, older_than=10 * 86400).expired == (1,)
    assert plan_vacuum(root, keep_last=100).expired == ()


def test_missing_limits_are_refused(root, raw):
    with pytest.raises(BadParameter, match="give keep_last or older_than"):
        plan_vacuum(root)
    with pytest.raises(BadParameter, match="keep at least the newest snapshot"):
        vacuum(root, keep_last=0)
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        vacuum(raw, keep_last=1)


def test_other_files_in_the_lake_are_not_touched(compacted):
    lake = Lake(compacted, snapshot=2)
    lake.filter(name="kept")
    lake.tag_where("odd", "scenario_id LIKE '%1'")
    for name in ("results/mine/run.json", "results/mine/results/000000.parquet", "notes.txt", "tracks/notes.txt"):
        (compacted / name).parent.mkdir(parents=True, exist_ok=True)
        (compacted / name).write_text("x")
    before = {name for name in stored(compacted) if name.split("/")[0] in ("databases", "layers", "results")}
    age(compacted, 2)
    vacuum(compacted, keep_last=1)
    assert {*before, "notes.txt", "tracks/notes.txt"} <= stored(compacted)
    assert len(Lake(compacted).database("kept")) == 8


def test_damaged_manifest_stops_vacuum(compacted):
    next(compacted.glob("snapshots/manifest-*")).write_bytes(b"PAR1")
    before = stored(compacted)
    with pytest.raises(LakeError, match="manifest-"):
        vacuum(compacted, keep_last=1)
    assert stored(compacted) == before


# --- databases ------------------------------------------------------------------------------------------


def test_snapshot_of_a_database_is_kept(raw, root):
    Lake(root).filter(name="old")
    write_raw(raw, {"s0": [0, 55]})
    convert_to(raw, root, replace=True)
    compact(root, "analytics")
    planned = plan_vacuum(root, keep_last=1)
    done = vacuum(root, keep_last=1)
    assert planned.expired == done.expired == (2,)
    assert (done.kept, done.needed) == ((1, 3), {1: ("old@1",)})
    with pytest.warns(StaleDatabaseWarning):
        assert "made/v1/s000001" in [scenario.id for scenario in ScenarioLoader(root, "old")]
    check_whole(root)
    Lake(root).drop("old")
    assert vacuum(root, keep_last=1).expired == (1,)
    check_whole(root)


@pytest.mark.long
def test_snapshot_of_a_concurrently_saved_database_is_restored(compacted, monkeypatch):
    old, expire = Lake(compacted, snapshot=1), snapshots.expire

    def saves(files, number):
        old.filter(name="late")
        expire(files, number)

    monkeypatch.setattr(snapshots, "expire", saves)
    done = vacuum(compacted, keep_last=1)
    assert (done.expired, done.kept, done.files) == ((), (1, 2), ())
    assert len(Lake(compacted, snapshot=1)) == 8
    check_whole(compacted)


# --- readers --------------------------------------------------------------------------------------------


def test_reading_an_expired_snapshot_raises_error(compacted):
    old = Lake(compacted, snapshot=1)
    loader, travelled = ScenarioLoader(old), pickle.loads(pickle.dumps(ScenarioLoader(old)))
    vacuum(compacted, keep_last=1)
    for read in (
        lambda: old.sql("SELECT count(*) FROM tracks"),
        lambda: old.paths("tracks") and old.sql("SELECT count(*) FROM metadata"),
        lambda: loader[0],
        lambda: travelled.tracks(3),
    ):
        with pytest.raises(NoSuchSnapshot, match=r"snapshot 1 has expired while it was read .*open the lake again"):
            read()
    with pytest.raises(NoSuchSnapshot, match=r"no snapshot 1; there are 2 \.\.\. 2, those before have expired"):
        Lake(compacted, snapshot=1)
    assert len(old.refresh()) == 8


def test_file_missing_for_another_reason_is_not_reported_as_expired(root):
    loader = ScenarioLoader(root)
    next(root.glob("tracks/*/*/*/*")).unlink()
    with pytest.raises(LakeError, match="No such file") as caught:
        list(loader)
    assert not isinstance(caught.value, NoSuchSnapshot)


def test_opening_the_newest_snapshot_while_it_expires_returns_the_next(raw, root, monkeypatch):
    numbers, seen = LocalLakeFiles.numbers, []

    def late(files, *words):
        if seen:
            return numbers(files, *words)
        seen.append(files)
        compact(root, "analytics")
        vacuum(root, keep_last=1)
        return [1]

    monkeypatch.setattr(LocalLakeFiles, "numbers", late)
    assert snapshots.read(LocalLakeFiles(root)).number == 2


# --- writers --------------------------------------------------------------------------------------------


def finished(raw, root):
    """Shards that a job has finished but not committed."""
    plan = plan_conversion(NAME, str(raw), root, options=OPTIONS)
    return [convert_shard(ShardJob(NAME, shard, str(root), check=False)) for shard in plan.shards]


def test_uncommitted_files_are_kept_for_a_day(raw, root):
    write_raw(raw, {"new": [77]})
    (outcome,) = finished(raw, root)
    assert len(vacuum(root, keep_last=1).young) == 4
    commits.commit(LocalLakeFiles(root), [outcome.record], "test")
    assert len(content(Lake(root))) == 9
    check_whole(root)


def test_uncommitted_files_are_removed_after_a_day_and_commit_reports_it(raw, root):
    write_raw(raw, {"new": [77]})
    (outcome,) = finished(raw, root)
    age(root, 1.1)
    assert len(vacuum(root, keep_last=1).files) == 4
    with pytest.raises(LakeError, match=r"shard new was finished; .* run the same command again"):
        commits.commit(LocalLakeFiles(root), [outcome.record], "test")
    assert convert(NAME, str(raw), root, options=OPTIONS).converted == 1
    check_whole(root)


def test_reused_files_get_a_new_timestamp(raw, root):
    write_raw(raw, {"new": [77]})
    finished(raw, root)
    age(root, 1.1)
    (again,) = finished(raw, root)
    assert again.was_finished
    assert vacuum(root, keep_last=1).files == ()
    commits.commit(LocalLakeFiles(root), [again.record], "test")
    check_whole(root)


def test_files_of_an_expired_snapshot_are_kept_once_reused(raw, root):
    """The files were replaced by a conversion with other options and are about to be committed again."""
    more = {"options": type(OPTIONS)(num_objects=3)}
    convert_to(raw, root, replace=True, **more)
    plan = plan_conversion(NAME, str(raw), root, options=OPTIONS, replace=True)
    back = [convert_shard(ShardJob(NAME, shard, str(root))) for shard in plan.shards]
    assert all(outcome.was_finished for outcome in back)
    done = vacuum(root, keep_last=1)
    assert done.expired == (1,)
    assert {listed.name.split("/")[0] for listed in done.files} == {"snapshots"}
    commits.commit(LocalLakeFiles(root), [outcome.record for outcome in back], "test", frozenset(plan.replaced))
    check_whole(root)


def test_file_touched_after_listing_is_kept(root):
    files = LocalLakeFiles(root)
    first, second = files.listing("tracks")[:2]
    os.utime(root / first.name, (first.modified - 5, first.modified - 5))
    assert not files.remove_unchanged(first)
    assert files.has(first.name)
    assert files.remove_unchanged(second)
    assert not files.has(second.name)
    assert not files.remove_unchanged(second)
    assert files.renew([first.name, second.name]) == [second.name]
    assert not list((root / ".tmp").iterdir())


def test_number_of_an_expired_snapshot_is_not_reused(compacted):
    """A slow job must not take an expired snapshot's number as free and believe that its own commit succeeded."""
    files = LocalLakeFiles(compacted)
    convert_to(write_raw(compacted.parent / "raw", {"n": [66]}), compacted)
    vacuum(compacted, keep_last=1)
    assert snapshots.numbers(files) == [3]
    assert not snapshots.publish(files, Snapshot(2, snapshots.now(), "slow", (), ()))
    assert snapshots.numbers(files) == [3]
    age(compacted, 1.1)
    vacuum(compacted, keep_last=1)
    assert not list(compacted.glob("snapshots/*.expired"))


@pytest.mark.long
def test_commit_retries_when_its_base_is_vacuumed(raw, compacted, monkeypatch):
    write_raw(raw, {"new": [77]})
    (outcome,) = finished(raw, compacted)
    files, column, happened = LocalLakeFiles(compacted), manifests.column, []

    def slow(files, base, name):
        if not happened:
            happened.append(1)
            convert_to(write_raw(raw, {"s0": [1, 2, 3]}), compacted, replace=True)
            vacuum(compacted, keep_last=1)
        return column(files, base, name)

    monkeypatch.setattr(manifests, "column", slow)
    commits.commit(files, [outcome.record], "slow")
    assert {"made/v1/s000077", "made/v1/s000003"} <= set(content(Lake(compacted)))
    check_whole(compacted)
