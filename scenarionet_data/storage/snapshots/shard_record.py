"""Records of finished shards, and the names of their files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields

from scenarionet_data.errors import LakeError
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles


@dataclass(frozen=True)
class ShardRecord:
    """A finished shard: a row of ``schemas/shards.toml``, which describes the fields."""

    key: str
    dataset: str
    version: str
    split: str
    name: str
    options: str
    converter_version: str
    schemas: str
    max_scenarios: int | None
    items: list[str]
    fingerprints: list[str]
    num_scenarios: int
    num_quarantined: int
    metadata_file: str | None
    files: list[str]
    sizes: list[int]
    checksums: list[str]


def partition(table: str, dataset: str, version: str, split: str) -> str:
    """Folder of a partition; maps have no split, and what belongs to a shared map has an empty one."""
    folder = f"{table}/dataset={dataset}/version={version}"
    return f"{folder}/split={split}" if split and table != "maps" else folder


def shard_key(shard: Shard, converter_version: str) -> str:
    """The shard's key, which depends on the versions of converter and table schemas."""
    return shard.key(f"{converter_version} {tables.content_tag()}")


def metadata_name(shard: Shard, key: str) -> str:
    """Name of a shard's metadata file; known in advance, so that a finished shard can be found."""
    return f"{partition('metadata', shard.dataset, shard.version, shard.split)}/{shard.name}-{key}.parquet"


def find_finished(files: LakeFiles, shard: Shard, converter_version: str) -> ShardRecord | None:
    """Record of a shard that an earlier job has finished, committed or not."""
    return find_record(files, metadata_name(shard, shard_key(shard, converter_version)))


def find_record(files: LakeFiles, name: str) -> ShardRecord | None:
    """Record in a shard's metadata file; None unless this file and all files of the shard exist and are intact.

    The files are renewed, which protects them from ``vacuum`` until they are committed.
    """
    if not files.has(name):
        return None
    files.path(name)  # raises if the store does not answer
    try:
        files.verify(name)
        record = record_of(files.footer(name).metadata)
        is_whole = files.sizes(record.files) == record.sizes
        is_intact = is_whole and [files.digest(file) for file in record.files] == record.checksums
    except (LakeError, ValueError, TypeError, KeyError):  # damaged after publication: convert the shard again
        return None
    return record if is_intact and not files.renew([name, *record.files]) else None


def record_of(footer: Mapping[bytes, bytes]) -> ShardRecord:
    """Record in the footer of a shard's metadata file.

    Raises:
        KeyError: It has none.
        ValueError, TypeError: It is damaged.
    """
    return ShardRecord(**json.loads(footer[b"scenarionet.shard"]))


def read_defects(files: LakeFiles, record: ShardRecord) -> list[Defect]:
    """What the conversion of a shard dropped or assumed."""
    names = [field.name for field in fields(Defect)]
    listed = [name for name in record.files if name.startswith("defects/")]
    return [Defect(**row) for name in listed for row in files.read(name, names).to_pylist()]
