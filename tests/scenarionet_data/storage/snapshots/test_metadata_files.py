"""Metadata is consolidated: large partitions have few files, independent of the commit order."""

from __future__ import annotations

import hashlib
import random

import pytest

from scenarionet_data import Lake
from scenarionet_data.storage.files.lake_files import sha256
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.lakes import stored_ids, write_shard
from tests.fixtures.scenarios import renamed, small


@pytest.fixture
def few(monkeypatch):
    """Lower the limits so that a few shards reach them."""
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 6)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 4)


def test_few_shards_keep_their_own_metadata_files(files, template, few):
    records = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(6)]
    commits.commit(files, records, "test")
    assert commits.consolidate(files).number == 1


def consolidated(root, template, groups):
    """Current metadata files and their content, after committing and consolidating groups of shards one by one."""
    files = LocalLakeFiles(root)
    for group in groups:
        records = [write_shard(root, [renamed(template, f"s{k}")], name=f"shard{k:03d}") for k in group]
        commits.commit(files, records, "test")
        commits.consolidate(files)
    live = snapshots.read(files).metadata
    return {name: sha256(files.path(name)) for name in live}


@pytest.mark.long
def test_consolidation_depends_only_on_the_shards(tmp_path, template, few):
    order = list(range(20))
    at_once = consolidated(tmp_path / "a", template, [order])
    random.Random(1).shuffle(order)
    in_parts = consolidated(tmp_path / "b", template, [order[:7], order[7:9], order[9:19], order[19:]])
    assert at_once == in_parts
    assert len(at_once) <= 4
    assert stored_ids(LocalLakeFiles(tmp_path / "b")) == sorted(f"made/v1/s{k}" for k in range(20))
    assert len(Lake(tmp_path / "b")) == 20


@pytest.mark.long
def test_adding_one_shard_changes_one_merged_file(tmp_path, template, few):
    before = consolidated(tmp_path, template, [range(20)])
    after = consolidated(tmp_path, template, [range(20), [20]])
    assert len(set(before) & set(after)) == len(after) - 1
    assert commits.consolidate(LocalLakeFiles(tmp_path)).number == snapshots.numbers(LocalLakeFiles(tmp_path))[-1]


def test_partitions_are_merged_separately(files, template, few):
    many = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(9)]
    val = [write_shard(files.root, [small(k, split="val")], name=f"shard{k}") for k in range(2)]
    commits.commit(files, [*many, *val], "test")
    live = commits.consolidate(files).metadata
    assert len([name for name in live if "split=train/merged-" in name]) <= 4
    assert {record.metadata_file for record in val} <= set(live)


def test_replacing_a_shard_within_a_merged_partition(files, template, few):
    records = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(9)]
    commits.commit(files, records, "test")
    commits.consolidate(files)
    new = write_shard(files.root, [renamed(template, "s3")], name="shard3", fingerprint="g")
    commits.commit(files, [new], "test", frozenset([records[3].key]))
    wanted = sorted(f"made/v1/s{k}" for k in range(9))
    assert stored_ids(files) == wanted
    assert commits.consolidate(files).operation == "consolidate metadata"
    assert stored_ids(files) == wanted
    assert all("merged" in name for name in snapshots.read(files).metadata)


def test_a_damaged_file_of_an_earlier_job_is_merged_again(files, template, few):
    records = [write_shard(files.root, [renamed(template, f"s{k}")], name=f"shard{k}") for k in range(9)]
    commits.commit(files, records, "test")
    wanted = metadata_files.layout(metadata_files.shard_files(records))
    name = next(name for name, sources in wanted.items() if sources != [name])
    files.path(name).write_bytes(b"half a file")
    assert name in commits.consolidate(files).metadata
    assert files.verify(name)
    assert stored_ids(files) == sorted(f"made/v1/s{k}" for k in range(9))


def test_names_of_merged_files_do_not_change_between_versions(few):
    own = [f"metadata/dataset=d/version=v/split=s/{k}.parquet" for k in range(9)]

    def digest(names):
        return hashlib.blake2b("\n".join(names).encode(), digest_size=8).hexdigest()

    parts = [[name for name in own if int(digest([name]), base=16) % 4 == k] for k in range(4)]
    expected = {f"metadata/dataset=d/version=v/split=s/merged-{digest(part)}.parquet": part for part in parts if part}
    assert metadata_files.layout(own) == expected


def test_large_partitions_stay_within_the_limit():
    own = [f"metadata/dataset=d/version=v/split=s/{k:05d}-{k:016x}.parquet" for k in range(3000)]
    wanted = metadata_files.layout(own)
    assert len(wanted) == metadata_files.MERGED_FILES <= metadata_files.MAX_METADATA_FILES
    assert sorted(name for sources in wanted.values() for name in sources) == own
    few = own[: metadata_files.MAX_METADATA_FILES]
    assert metadata_files.layout(few) == {name: [name] for name in few}
