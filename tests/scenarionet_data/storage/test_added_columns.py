"""Lakes written before a nullable column was added: they open, with nulls in that column."""

from __future__ import annotations

import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import SchemaMismatch
from scenarionet_data.maintenance.compaction import compact
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import metadata_files
from scenarionet_data.testing import differences
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.schema_versions import appending, as_added, raise_version

ADDRESSES = ("_file", "_row_group", "_first_row")
DROPPABLE = [
    (table, column.name)
    for table in ("metadata", "tracks", "lights", "maps", "shards")
    for column in tables.load(table).columns
    if column.nullable and not column.name.endswith(ADDRESSES)
]
SCORE = tables.Column("score", "float32", "A column that was added.", nullable=True)


def made(seed):
    return make_scenario(seed, num_objects=3, num_steps=11, num_lights=2)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = tmp_path_factory.mktemp("before") / "lake"
    write_lake(root, [made(seed) for seed in range(3)], name="a")
    write_lake(root, [made(seed) for seed in range(3, 5)], name="b")
    return root


def drop(lake, table, column):
    """Rewrite the files of a table without one column, row group by row group."""
    for name in lake.paths(table):
        old = pq.ParquetFile(name)
        footer = {k: v for k, v in old.metadata.metadata.items() if k != b"ARROW:schema"}
        groups = [old.read_row_group(k).drop_columns([column]) for k in range(old.num_row_groups)]
        with pq.ParquetWriter(name, groups[0].schema.with_metadata(footer), write_page_checksum=True) as writer:
            for group in groups:
                writer.write_table(group)
        seals.seal(Path(name), seals.Place(Path(name).relative_to(lake.root).as_posix()))


def rows(root, table, without):
    names = [column.name for column in tables.load(table).columns if column.name != without]
    found = Lake(root).sql(f"SELECT {', '.join(names)} FROM {table}")
    return sorted(map(str, found.to_dicts()))


@pytest.mark.long
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chosen=st.sampled_from(DROPPABLE))
def test_nullable_column_missing_in_files_reads_as_null(written, tmp_path, chosen):
    table, column = chosen
    root = tmp_path / f"{table}-{column}"
    if root.exists():
        return
    shutil.copytree(written, root)
    before = rows(root, table, column)
    drop(Lake(root), table, column)
    with pytest.MonkeyPatch.context() as patch:
        raise_version(patch, table, as_added(column))
        assert rows(root, table, column) == before
        if (table, column) != ("metadata", "timestamps"):  # filled with null by the view
            assert Lake(root).sql(f"SELECT count({column}) AS n FROM {table}")["n"][0] == 0
        loaded = ScenarioLoader(root)
        assert [scenario.id for scenario in loaded] == [scenario.id for scenario in loaded.batch(range(5))]
        assert len(Lake(root).filter("num_objects > 0", name="all")) == 5


def test_lake_accepts_commits_after_column_was_added(written, tmp_path, monkeypatch):
    root = shutil.copytree(written, tmp_path / "lake")
    raise_version(monkeypatch, "metadata", appending(SCORE))
    wanted = [made(seed) for seed in range(7)]
    lake = write_lake(root, wanted[5:], name="c")
    counts = "SELECT count(*) AS n, count(score) AS scores FROM {}"
    assert lake.sql(counts.format("metadata")).row(0) == (7, 0)
    assert lake.filter("score IS NULL", name="unscored").scenario_ids == [scenario.id for scenario in wanted]
    assert [differences(*pair) for pair in zip(ScenarioLoader(lake), wanted, strict=True)] == [[]] * 7

    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 1)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 1)
    commits.consolidate(open_files(root))
    assert len(Lake(root).paths("metadata")) == 1
    assert Lake(root).sql(counts.format("metadata")).row(0) == (7, 0)

    assert not compact(root, "analytics").failed
    lake = Lake(root)
    assert [differences(*pair) for pair in zip(ScenarioLoader(lake), wanted, strict=True)] == [[]] * 7
    assert fsck(root).is_whole
    lake.pack("unscored", tmp_path / "pack")
    assert verify_pack(tmp_path / "pack").is_whole
    assert Lake(tmp_path / "pack").sql(counts.format("metadata")).row(0) == (7, 0)


def test_newer_files_are_refused(written, tmp_path, monkeypatch):
    root = shutil.copytree(written, tmp_path / "lake")
    with monkeypatch.context() as newer:
        raise_version(newer, "metadata", appending(SCORE))
        write_lake(root, [made(5)], name="c")
    newer = f"metadata/{tables.load('metadata').version + 1}"
    with pytest.raises(SchemaMismatch, match=rf"shard c was written under .*{newer}.*, this version reads"):
        len(Lake(root))


def test_versions_before_the_oldest_are_refused():
    table = tables.load("tracks")
    assert table.reads("tracks/1")
    assert not table.reads(f"tracks/{table.version + 1}")
    assert not table.reads("lights/1")
    assert not table.reads("none")
    assert not tables.reads_content("tracks/1 other/1")


@pytest.mark.parametrize("name", tables.TABLES)
def test_only_nullable_columns_are_added(name):
    table = tables.load(name)
    assert 1 <= table.oldest <= table.version
    assert all(column.nullable and column.since <= table.version for column in table.added)
