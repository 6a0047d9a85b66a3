"""Which files hold a lake's metadata: each shard's own, and merged ones in their place where a partition has many.

Which they are is a function of a lake's shards alone, whatever the order of the commits: up to MAX_METADATA_FILES
shards of a partition keep their own files; of more, each stands in the one of MERGED_FILES that its name's hash
chooses.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath

import pyarrow as pa

from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write.table_file import write_table

MAX_METADATA_FILES = 64
"""Live metadata files of a partition; more are merged (3,000 files of 64 rows take 0.7 s to count)."""

MERGED_FILES = 16
"""Files that a larger partition has instead; one more shard changes one of them."""

_ROWS_PER_GROUP = 65_536


def own(records: Iterable[ShardRecord]) -> list[str]:
    """The shards' own metadata files; a shared map has none."""
    return [record.metadata_file for record in records if record.metadata_file is not None]


def own_with_schemas(files: LakeFiles, base: Snapshot) -> dict[str, str]:
    """Own metadata file of every shard of a snapshot to the version of the contract it was written under."""
    names, schemas = (manifests.column(files, base, name).to_pylist() for name in ("metadata_file", "schemas"))
    return {name: schema for name, schema in zip(names, schemas, strict=True) if name is not None}


def layout(schemas: Mapping[str, str]) -> dict[str, list[str]]:
    """Metadata files that a lake of some shards has, and the shards' own files each is made of.

    Args:
        schemas: Of the shards, see :func:`own_with_schemas`.
    """
    partitions: dict[str, list[str]] = defaultdict(list)
    for name in sorted(schemas):
        partitions[_folder(name)].append(name)
    wanted: dict[str, list[str]] = {}
    for folder, names in partitions.items():
        # Files of different contracts stay apart until the last of the old ones has been replaced.
        if len(names) <= MAX_METADATA_FILES or len({schemas[name] for name in names}) > 1:
            wanted |= {name: [name] for name in names}
            continue
        chosen: dict[int, list[str]] = defaultdict(list)
        for name in names:
            chosen[int(_digest(name), 16) % MERGED_FILES].append(name)
        wanted |= {f"{folder}/merged-{_digest(*chosen[k])}.parquet": chosen[k] for k in sorted(chosen)}
    return wanted


def merge(files: LakeFiles, schemas: Mapping[str, str]) -> tuple[str, ...]:
    """The metadata files that a lake of some shards has, those published that are not there yet.

    Args:
        files: The lake.
        schemas: Of the shards, see :func:`own_with_schemas`.
    """
    wanted = layout(schemas)
    for name, sources in wanted.items():
        if sources != [name] and files.renew([name]):
            _merge(files, name, sources)
    return tuple(wanted)


def merge_again(files: LakeFiles, names: Iterable[str]) -> None:
    """Publish merged metadata files of the newest snapshot once more, as they were, for example damaged ones."""
    base = snapshots.read(files)
    wanted = layout(own_with_schemas(files, base))
    for name in set(names) & set(wanted) & set(base.metadata):
        if wanted[name] != [name]:
            _merge(files, name, wanted[name])


def live(
    base: Snapshot, held: Sequence[ShardRecord], gone: frozenset[str], moved: Sequence[ShardRecord] = ()
) -> tuple[str, ...]:
    """Metadata files of a snapshot without the rows of shards that go, and with others' rows as they were rewritten.

    The partitions of both fall back to the shards' own files.

    Args:
        base: The snapshot.
        held: Its shards.
        gone: Keys of those that go.
        moved: Those that lie in other files now.
    """
    if not gone:
        return base.metadata
    now = {record.key: record for record in held if record.key not in gone} | {record.key: record for record in moved}
    touched = {_folder(name) for name in own(record for record in held if record.key in gone)}
    kept = [name for name in base.metadata if _folder(name) not in touched]
    return (*kept, *(name for name in own(now.values()) if _folder(name) in touched))


def _merge(files: LakeFiles, name: str, sources: list[str]) -> None:
    """Publish shards' own metadata files, one after the other, as one."""
    together = pa.concat_tables(files.read_all(sources))
    files.publish(write_table(files, "metadata", together, {}, row_group_size=_ROWS_PER_GROUP), name)


def _digest(*names: str) -> str:
    return hashlib.blake2b("\n".join(names).encode(), digest_size=8).hexdigest()


def _folder(name: str) -> str:
    return str(PurePosixPath(name).parent)
