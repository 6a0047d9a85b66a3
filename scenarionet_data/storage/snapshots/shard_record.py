"""Records of finished shards, and the names of their files."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from operator import attrgetter, itemgetter

from scenarionet_data.errors import LakeError
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.seals import Sealed

_DEFECT = [field.name for field in fields(Defect)]


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


def make_record(
    shard: Shard,
    converter_version: str,
    published: Iterable[Sealed],
    num_scenarios: int = 0,
    num_quarantined: int = 0,
    max_scenarios: int | None = None,
) -> ShardRecord:
    """Record of a finished shard; that of a shared map, whose shard has no split, has no metadata file.

    Args:
        shard: The shard.
        converter_version: Version of the converter.
        published: Its files besides the metadata file.
        num_scenarios, num_quarantined, max_scenarios: See the table.
    """
    key = shard_key(shard, converter_version)
    record = ShardRecord(
        key=key,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        name=shard.name,
        options=shard.options_text,
        converter_version=converter_version,
        schemas=tables.content_tag(),
        max_scenarios=max_scenarios,
        items=list(map(attrgetter("name"), shard.items)),
        fingerprints=list(map(attrgetter("fingerprint"), shard.items)),
        num_scenarios=num_scenarios,
        num_quarantined=num_quarantined,
        metadata_file=metadata_name(shard, key) if shard.split else None,
        files=[],
        sizes=[],
        checksums=[],
    )
    return with_files(record, published)


def with_files(record: ShardRecord, published: Iterable[Sealed]) -> ShardRecord:
    """The record with other files."""
    listed = list(published)
    names, sizes, checksums = (list(map(itemgetter(place), listed)) for place in range(3))
    return replace(record, files=names, sizes=sizes, checksums=checksums)


def files_of(record: ShardRecord, *folders: str) -> list[Sealed]:
    """Files of a record in some folders, each with a slash at the end."""
    listed = map(Sealed, record.files, record.sizes, record.checksums)
    return [each for each in listed if each.name.startswith(folders)]


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
        record = ShardRecord(**json.loads(files.footer(name).metadata[b"scenarionet.shard"]))
        is_whole = files.sizes(record.files) == record.sizes
        is_intact = is_whole and [files.digest(file) for file in record.files] == record.checksums
    except (LakeError, ValueError, TypeError, KeyError):  # damaged after publication: convert the shard again
        return None
    return record if is_intact and not files.renew([name, *record.files]) else None


def read_defects(files: LakeFiles, record: ShardRecord) -> list[Defect]:
    """What the conversion of a shard dropped or assumed."""
    found = list[Defect]()
    for name in record.files:
        if name.startswith("defects/"):
            found += [Defect(**row) for row in files.read(name, _DEFECT).to_pylist()]
    return found
