"""Cost of a lake's metadata as it grows, measured on synthetic shard records.

From these figures ``docs/guides/cluster.md`` reckons where today's design ends.
"""

from __future__ import annotations

import pickle
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenarionet_data.conversion import ShardJob
from scenarionet_data.conversion.plan import make_plan
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, metadata_name, partition
from tests.bench.measure import Figure
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import make_scenario

_SHARDS = 50_000
_COMMITTED = 400


def figures(_: Path | None) -> Iterator[Figure]:
    """Bytes and seconds per shard, by metadata file."""
    with tempfile.TemporaryDirectory() as folder:
        yield from _books(Path(folder))
        yield from _commits(Path(folder) / "lake")


def _books(root: Path) -> Iterator[Figure]:
    """Planning against a lake of many shards, and the size of its manifests."""
    tracemalloc.start()
    wanted = [_shard(number) for number in range(_SHARDS)]
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    yield Figure("a planned shard of one file, in the client's memory", size / _SHARDS, "bytes")
    yield Figure("a job, as it travels to a worker", len(pickle.dumps(ShardJob("waymo", wanted[0], "/lake"))), "bytes")
    files, held = LocalLakeFiles(root / "books"), [_record(shard) for shard in wanted]
    started = time.process_time()
    (manifest,) = manifests.write(files, snapshots.EMPTY, held, frozenset())
    yield Figure("a manifest: written", 1e6 * (time.process_time() - started) / _SHARDS, "us a shard")
    yield Figure("a manifest: size", files.path(manifest).stat().st_size / _SHARDS, "bytes a shard")
    names = tuple(record.metadata_file or "" for record in held)
    snapshot = replace(snapshots.EMPTY, number=1, metadata=names, manifests=(manifest,))
    yield Figure("a snapshot before consolidation: size", len(snapshot.to_bytes()) / _SHARDS, "bytes a shard")
    started = time.process_time()
    read = manifests.shards(files, snapshot)
    yield Figure("a manifest: read as records", 1e6 * (time.process_time() - started) / _SHARDS, "us a shard")
    started = time.process_time()
    assert make_plan(wanted, read, "1").num_skipped == _SHARDS
    yield Figure("planning against what the lake holds", 1e6 * (time.process_time() - started) / _SHARDS, "us a shard")


def _commits(root: Path) -> Iterator[Figure]:
    """A commit, which reads the new ids once, and the next one, which compares with all of them."""
    files = LocalLakeFiles(root)
    records = [write_shard(root, [make_scenario(k, num_objects=1)], f"s{k:04d}", f"f{k}") for k in range(_COMMITTED)]
    started = time.process_time()
    commits.commit(files, records[:-1], "all but one")
    first = time.process_time() - started
    started = time.process_time()
    commits.commit(files, records[-1:], "one more")
    second = time.process_time() - started
    yield Figure("a commit: CPU time for each new shard", 1e3 * first / _COMMITTED, "ms")
    yield Figure("the next commit: CPU time for each shard that is there", 1e3 * second / _COMMITTED, "ms")
    (size,) = {files.path(record.metadata_file or "").stat().st_size for record in records[:1]}
    yield Figure("a metadata file of one scenario", size / 1000, "kB")
    started = time.process_time()
    merged = commits.consolidate(files)
    yield Figure("consolidation of metadata", 1e3 * (time.process_time() - started) / _COMMITTED, "ms a shard")
    rows = sum(files.path(name).stat().st_size for name in merged.metadata) / _COMMITTED
    yield Figure("a row of merged metadata", rows, "bytes")


def _shard(number: int) -> Shard:
    name = f"uncompressed_scenario_training_training.tfrecord-{number:05d}-of-50000"
    return Shard("waymo", "v1.3", "train", name, "/raw", (RawItem(name, f"{number:016x}"),), Options())


def _record(shard: Shard) -> ShardRecord:
    """The record of a shard with one file of each table, as most have."""
    key, kinds = shard.key("1"), ("tracks", "lights", "maps")
    folders = [partition(table, shard.dataset, shard.version, shard.split) for table in kinds]
    return ShardRecord(
        key=key,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        name=shard.name,
        options=shard.options_text,
        converter_version="1",
        schemas=tables.content_tag(),
        max_scenarios=None,
        items=[item.name for item in shard.items],
        fingerprints=[item.fingerprint for item in shard.items],
        num_scenarios=64,
        num_quarantined=0,
        metadata_file=metadata_name(shard, key),
        files=[f"{folder}/{shard.name}-000-{key}.parquet" for folder in folders],
        sizes=[9_000_000] * 3,
        checksums=[4 * key] * 3,
    )
