"""compact: the same scenarios in other files, also while others read, convert or replace."""

from __future__ import annotations

import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import BadParameter, NoSuchSnapshot
from scenarionet_data.maintenance import bin_packing, compact, compaction, plan_compaction, vacuum
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.schema import tables
from scenarionet_data.schema.tables import LOADED
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.read.parquet import column_reader
from scenarionet_data.storage.snapshots import manifests, metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.made import NAME, write_raw
from tests.scenarionet_data.maintenance.conftest import OPTIONS, check_whole, content, convert_to, rows

pytestmark = pytest.mark.integration


def groups(root, table="tracks"):
    """Rows of each row group, by file."""
    footers = [pq.read_metadata(path) for path in Lake(root).paths(table)]
    return [[footer.row_group(k).num_rows for k in range(footer.num_row_groups)] for footer in footers]


def records(root):
    files = LocalLakeFiles(root)
    return {record.name: record for record in manifests.shards(files, snapshots.read(files))}


def test_compaction_changes_only_file_addresses(root):
    lake = Lake(root)
    database = lake.filter(name="all")
    before, counted, keys = content(lake), rows(root), {r.key for r in records(root).values()}
    done = compact(root, "analytics")
    assert (done.shards, done.scenarios, done.files_before, done.files_after) == (4, 8, 12, 3)
    assert done.bytes_after < done.bytes_before
    assert (done.failed, done.left, done.snapshot) == ([], 0, 2)
    assert snapshots.read(LocalLakeFiles(root)).operation == "compact for analytics"
    assert groups(root) == [[6, 6, 4]]
    after = Lake(root)
    assert content(after) == before
    assert rows(root) == counted
    assert {r.key for r in records(root).values()} == keys
    assert after.resolve("all")[1].column("scenario_id").to_pylist() == database.scenario_ids
    assert [scenario.id for scenario in ScenarioLoader(after, "all")] == database.scenario_ids
    assert [result for result in run_checks(after).results if result.is_hard and not result.is_met] == []
    check_whole(root)
    assert content(Lake(root, snapshot=1)) == before


@pytest.mark.long
def test_training_profile_keeps_row_groups_of_conversion_in_fewer_files(root):
    before = content(Lake(root))
    compact(root, "training")
    assert groups(root) == [[2] * 8]
    compact(root, "analytics")
    compact(root, "training")
    assert groups(root) == [[2] * 8]
    assert content(Lake(root)) == before
    check_whole(root)


def test_archive_is_in_zstd_and_loads_without_arrow(root, monkeypatch):
    before = content(Lake(root))
    compact(root, "archive")
    assert groups(root) == [[2] * 8]
    for table in LOADED:
        dictionaries = {column.path for column in tables.load(table).columns if column.element == "dictionary"}
        for path in Lake(root).paths(table):
            stored = pq.read_metadata(path).row_group(0)
            for column in map(stored.column, range(stored.num_columns)):
                assert column.compression == ("LZ4" if column.path_in_schema in dictionaries else "ZSTD")
    with monkeypatch.context() as patch:
        patch.setattr(column_reader.ColumnReader.__init__, "__defaults__", (None, 0))
        patch.setattr(column_reader, "read_by_arrow", None)
        assert content(Lake(root)) == before
    check_whole(root)
    compact(root, "training")
    assert "ZSTD" not in str(pq.read_metadata(Lake(root).paths("tracks")[0]).row_group(0).to_dict())


@pytest.mark.parametrize("profile", ["training", "analytics", "archive"])
def test_second_compaction_does_nothing(root, profile):
    compact(root, profile)
    again = compact(root, profile)
    assert (again.shards, again.snapshot) == (0, 2)
    assert plan_compaction(root, profile) == []


@pytest.mark.long
def test_new_shards_are_added_to_partly_filled_files(raw, root):
    compact(root, "analytics")  # 8 of 8
    convert_to(write_raw(raw, {"t0": [70, 71]}), root)
    assert compact(root, "analytics").shards == 1
    convert_to(write_raw(raw, {"t1": [80, 81]}), root)
    assert compact(root, "analytics").shards == 2
    assert sorted(groups(root)) == [[6, 2], [6, 6, 4]]  # files are named by their content
    check_whole(root)


@pytest.mark.long
def test_bins_respect_the_limit_and_large_shards_are_split_evenly(raw, root, monkeypatch):
    monkeypatch.setattr(bin_packing, "_SCENARIOS_PER_BIN", 5)
    assert [each.num_scenarios for each in plan_compaction(root, "analytics")] == [4, 4]
    convert_to(write_raw(raw, {"large": list(range(100, 118))}), root)
    plan = plan_compaction(root, "analytics", where={"split": "train"})
    assert [[r.name for r in each.records] for each in plan] == [["large"], ["s0", "s1"], ["s2", "s3"]]
    compact(root, "analytics")
    assert sorted(map(sum, groups(root))) == [8, 8, 12, 12, 12]
    check_whole(root)


def test_where_selects_partitions(raw, root):
    convert_to(write_raw(raw.parent / "val", {"v0": [60], "v1": [61]}), root)
    assert {r.split for each in plan_compaction(root, where={"split": "v*"}) for r in each.records} == {"val"}
    assert compact(root, where={"split": "val", "dataset": "made"}).shards == 2
    assert compact(root, where={"version": "v9"}).shards == 0
    with pytest.raises(BadParameter, match="where: unknown key 'city'; select by dataset, version, split"):
        compact(root, where={"city": "x"})
    with pytest.raises(BadParameter, match="no profile 'speed'; choose one of training, analytics, archive"):
        compact(root, "speed")
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        compact(raw)


# --- conversion after compaction ------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [pytest.param("training", marks=pytest.mark.long), "analytics"])
def test_second_conversion_skips_and_replacing_one_shard_keeps_the_others(raw, root, profile):
    compact(root, profile)
    before = content(Lake(root))
    report = convert(NAME, str(raw), root, options=OPTIONS, check=False)
    assert (report.skipped, report.shards, report.snapshot) == (4, 0, 2)
    write_raw(raw, {"s1": [10, 99]})
    report = convert(NAME, str(raw), root, options=OPTIONS, replace=True, check=False)
    assert (report.replaced, report.converted, report.skipped) == (1, 2, 3)
    after = content(Lake(root))
    assert set(after) == set(before) - {"made/v1/s000011"} | {"made/v1/s000099"}
    assert {i: h for i, h in after.items() if i in before} == {i: h for i, h in before.items() if i in after}
    assert len({r.metadata_file for r in records(root).values()}) == 4
    check_whole(root)
    assert content(Lake(root, snapshot=2)) == before


@pytest.mark.long
def test_replacing_all_shards_of_a_file_rewrites_nothing(raw, root, monkeypatch):
    compact(root, "analytics")
    monkeypatch.setattr("scenarionet_data.storage.write.rewriting.rewrite", None)
    write_raw(raw, {f"s{k}": [500 + k] for k in range(4)})
    assert convert(NAME, str(raw), root, options=OPTIONS, replace=True, check=False).replaced == 4
    check_whole(root)


def test_quarantine_is_kept(raw, root):
    convert_to(write_raw(raw, {"bad": ["90 invalid", 91]}), root)
    compact(root, "analytics")
    assert len(Lake(root).sql("FROM quarantine")) == 1
    check_whole(root)


@pytest.mark.long
def test_large_partitions_keep_few_metadata_files(raw, root, monkeypatch):
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 3)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 2)
    before = content(Lake(root))
    done = compact(root, "analytics")
    assert done.snapshot == 2  # one snapshot, already merged
    assert len(Lake(root).paths("metadata")) <= 2
    assert content(Lake(root)) == before
    check_whole(root)


# --- concurrent changes ---------------------------------------------------------------------------------


def with_concurrent_change(happens):
    """Run bins serially; trigger a concurrent change after the first is rewritten."""

    def run(jobs, do, lost=None):
        for number, job in enumerate(jobs):
            yield do(job)
            if number == 0:
                happens()

    return run


def test_concurrent_conversion_loses_nothing(raw, root):
    def converts():
        convert_to(write_raw(raw, {"new": [77]}), root)

    done = compact(root, "analytics", executor=with_concurrent_change(converts))
    assert (done.shards, done.left) == (4, 0)
    assert len(content(Lake(root))) == 9
    check_whole(root)


@pytest.mark.long
def test_concurrently_replaced_shards_are_planned_again(raw, root):
    happened = []

    def replaces():
        if not happened:
            happened.append(convert_to(write_raw(raw, {"s2": [20, 98]}), root, replace=True))

    done = compact(root, "analytics", executor=with_concurrent_change(replaces))
    assert (done.shards, done.left) == (4, 0)
    assert "made/v1/s000098" in content(Lake(root))
    assert "made/v1/s000021" not in content(Lake(root))
    check_whole(root)


@pytest.mark.long
def test_concurrently_vacuumed_files_are_not_reported_as_damage(raw, root, monkeypatch):
    """The second bin's files are gone before it is rewritten, because their shards have been replaced."""
    monkeypatch.setattr(bin_packing, "_SCENARIOS_PER_BIN", 4)
    happened = []

    def replaces():
        if not happened:
            happened.append(convert_to(write_raw(raw, {"s2": [20], "s3": [30]}), root, replace=True))
            vacuum(root, keep_last=1)

    done = compact(root, "analytics", executor=with_concurrent_change(replaces))
    assert (done.shards, done.left, done.failed) == (4, 0, [])
    check_whole(root)


def test_two_concurrent_compactions_equal_one(root):
    done = compact(root, "analytics", executor=with_concurrent_change(lambda: compact(root, "analytics")))
    assert (done.shards, done.left, done.snapshot) == (0, 0, 2)
    check_whole(root)


@pytest.mark.long
def test_endless_conflicts_raise_error(raw, root):
    seeds = iter(range(200, 300))

    def replaces():
        convert_to(write_raw(raw, {"s2": [next(seeds)]}), root, replace=True)

    done = compact(root, "analytics", executor=with_concurrent_change(replaces))
    assert done.left == 4
    check_whole(root)


def test_finished_bins_of_a_killed_run_are_reused(root, monkeypatch):
    monkeypatch.setattr(bin_packing, "_SCENARIOS_PER_BIN", 4)

    def killed(jobs, do, lost=None):
        yield do(next(iter(jobs)))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compact(root, "analytics", executor=killed)
    assert snapshots.read(LocalLakeFiles(root)).number == 1
    written = {path.name: path.stat().st_ino for path in root.rglob("*.parquet")}
    done = compact(root, "analytics")
    assert done.shards == 4
    assert written.items() <= {path.name: path.stat().st_ino for path in root.rglob("*.parquet")}.items()
    check_whole(root)


def test_damaged_file_fails_only_its_own_bin(root, monkeypatch):
    monkeypatch.setattr(bin_packing, "_SCENARIOS_PER_BIN", 4)
    record = records(root)["s3"]
    (root / record.files[0]).write_bytes(b"PAR1")
    done = compact(root, "analytics")
    assert done.shards == 2
    ((name, reason),) = done.failed
    assert name == "s2"
    assert record.files[0] in reason
    assert len(Lake(root)) == 8


@pytest.mark.long
def test_same_shards_give_identical_files(raw, tmp_path):
    made: list = []
    for name in ("one", "two"):
        root = convert_to(raw, tmp_path / name)
        jobs = plan_compaction(root, "training")
        made.append([compaction.rewrite_bin(job).records for job in jobs])
    assert made[0] == made[1]


@pytest.mark.long
def test_packs_of_compacted_lakes_hold_only_their_members(root, tmp_path):
    lake = Lake(root)
    before = content(lake)
    lake.filter("scenario_id LIKE '%1'", name="odd")
    compact(root, "analytics")
    Lake(root).pack("odd", tmp_path / "pack")
    assert verify_pack(tmp_path / "pack").is_whole
    packed = Lake(tmp_path / "pack")
    assert content(packed) == {i: h for i, h in before.items() if i.endswith("1")}
    assert packed.sql("SELECT count(*) FROM tracks").item() == 8


def test_file_that_fails_verification_is_refused(root, monkeypatch):
    from scenarionet_data.storage.read.scenario_rows import ScenarioRows

    read = ScenarioRows.read
    wrong = lambda self, address: read(self, address._replace(row_group=0))  # noqa: E731
    monkeypatch.setattr(ScenarioRows, "read", wrong)
    done = compact(root, "analytics")
    assert "read back other rows than were written" in done.failed[0][1]
    assert snapshots.read(LocalLakeFiles(root)).number == 1
