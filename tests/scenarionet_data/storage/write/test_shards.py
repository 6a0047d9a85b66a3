"""One shard: its files, its record, and its reuse by a later run."""

from __future__ import annotations

from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import sha256
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots.shard_record import find_finished
from scenarionet_data.storage.write import shard_writer
from scenarionet_data.storage.write.shard_writer import ShardWriter
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import renamed, small


def shard_of(name="a", items=("x",)):
    return Shard("made", "v1", "train", name, "/raw", tuple(RawItem(i, "f") for i in items), Options())


def test_shard_has_one_row_group_per_scenario_and_few_scenarios_per_file(files, template, monkeypatch):
    monkeypatch.setattr(shard_writer, "SCENARIOS_PER_FILE", 3)
    record = write_shard(files.root, [renamed(template, f"s{k}") for k in range(7)])
    assert record.num_scenarios == 7
    tracks = [name for name in record.files if name.startswith("tracks/")]
    groups = [pq.read_metadata(files.path(name)).num_row_groups for name in tracks]
    assert groups == [3, 3, 1]
    rows = pq.ParquetFile(files.path(record.metadata_file)).read().to_pylist()
    assert [(row["tracks_file"], row["tracks_row_group"]) for row in rows] == [
        (tracks[k // 3], k % 3) for k in range(7)
    ]
    assert {row["tracks_first_row"] for row in rows} == {0}
    assert {row["tracks_num_rows"] for row in rows} == {2}


def test_record_lists_every_file_with_size_and_checksum(files, template):
    record = write_shard(files.root, [template])
    found = {str(p.relative_to(files.root)) for p in files.root.rglob("*.parquet")}
    assert found == {*record.files, record.metadata_file}
    for name, size, checksum in zip(record.files, record.sizes, record.checksums, strict=True):
        path = files.path(name)
        assert (path.stat().st_size, sha256(path)) == (size, checksum)
        footer = pq.read_metadata(path).metadata
        assert footer[b"scenarionet.schema"].decode() == tables.load(name.split("/")[0]).tag
        assert footer[b"scenarionet.licence"] == b"CC0"
    assert not list((files.root / ".tmp").iterdir())


def test_same_shard_writes_identical_files(tmp_path):
    records = [write_shard(tmp_path / name, [small(k) for k in range(3)]) for name in ("first", "second")]
    assert records[0] == records[1]


def test_shard_without_scenarios_is_finished(files):
    writer = ShardWriter(files, shard_of(), "1", "CC0")
    writer.reject(4, InvalidScenario("made/v1/x", "dt", "wanted more"))
    writer.reject(5, ValueError("odd"))
    record = writer.finish()
    assert (record.num_scenarios, record.num_quarantined) == (0, 2)
    commits.commit(files, [record], "test")
    lake = Lake(files.root)
    assert len(lake) == 0
    rows = lake.sql("SELECT position, scenario_id, error, field, message FROM quarantine ORDER BY position").rows()
    assert rows == [
        (4, "made/v1/x", "InvalidScenario", "dt", "wanted more"),
        (5, None, "ValueError", None, "odd"),
    ]


def test_duplicate_id_within_a_shard_is_refused(files, template):
    writer = ShardWriter(files, shard_of(), "1", "CC0")
    writer.add(template)
    with pytest.raises(InvalidScenario, match="found it twice"):
        writer.add(template)
    assert writer.finish().num_scenarios == 1


@pytest.mark.parametrize("field", ["dataset", "version", "split"])
def test_scenario_of_another_partition_is_refused(files, field):
    writer = ShardWriter(files, shard_of(), "1", "CC0")
    with pytest.raises(InvalidScenario, match=f"{field}: wanted .*, found 'other'"):
        writer.add(small(1, **{field: "other"}))


def test_aborted_shard_leaves_no_files(files, template):
    writer = ShardWriter(files, shard_of(), "1", "CC0")
    writer.add(template)
    writer.abandon()
    assert [path for path in files.root.rglob("*") if path.is_file()] == []


def test_finished_shard_is_found_unless_a_file_is_missing_or_truncated(files, template):
    record = write_shard(files.root, [template])
    shard = replace(shard_of("a", ["a.raw"]))
    assert find_finished(files, shard, "1") == record
    assert find_finished(files, shard, "2") is None
    assert find_finished(files, shard_of("a", ["b.raw"]), "1") is None
    for name in (*record.files, record.metadata_file):
        whole = files.path(name).read_bytes()
        files.path(name).write_bytes(whole[:-1])
        assert find_finished(files, shard, "1") is None, name
        files.path(name).unlink()
        assert find_finished(files, shard, "1") is None, name
        files.path(name).write_bytes(whole)
    assert find_finished(files, shard, "1") == record


def test_finished_shard_of_another_schema_is_not_reused(files, template, monkeypatch):
    write_shard(files.root, [template])
    monkeypatch.setattr("scenarionet_data.schema.tables.content_tag", lambda: "tracks/2")
    assert find_finished(files, shard_of("a", ["a.raw"]), "1") is None
