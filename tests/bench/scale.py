"""Millions of scenarios: opening, filtering, saving and loading, over a metadata table like that of 2,000 shards."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from scenarionet_data import codec
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, partition
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write.table_file import publish_table
from tests.bench.measure import Figure, in_fresh_process
from tests.fixtures.scenarios import make_scenario

_SHARD_ROWS = 500

_FILTER = """
import json, statistics, sys, time, warnings
started = time.perf_counter()
from scenarionet_data import Lake
imported = time.perf_counter() - started
started = time.perf_counter()
Lake(sys.argv[1]).filter("ego_distance > 10 AND num_objects > 200", name="once")
first = time.perf_counter() - started
status = open("/proc/self/status").read()  # ru_maxrss would count the parent's peak too
peak_mb = int(status.split("VmHWM:")[1].split()[0]) / 1024
opens, filters, busy, counts = [], [], [], []
for k in range(5):
    started = time.perf_counter()
    lake = Lake(sys.argv[1])
    opens.append(time.perf_counter() - started)
    started, worked = time.perf_counter(), time.process_time()
    database = lake.filter("ego_distance > 10 AND num_objects > 200", name=f"busy{k}")
    filters.append(time.perf_counter() - started)
    busy.append(time.process_time() - worked)
    started = time.perf_counter()
    lake.sql("SELECT count(*) FROM metadata WHERE ego_distance > 10 AND num_objects > 200")
    counts.append(time.perf_counter() - started)
print(json.dumps({
    "import": imported, "open": statistics.median(opens), "first_open": opens[0],
    "first_filter": first, "filter": statistics.median(filters), "busy": statistics.median(busy),
    "count": statistics.median(counts), "members": len(database), "peak_mb": peak_mb,
    "bytes": (lake.root / "databases" / database.name / "1.parquet").stat().st_size,
}))
"""


_OPERATIONS = {
    "filter that keeps all": ('lake.filter(name="new", replace=True)', 1.5),
    "filter that keeps half": ('lake.filter("ego_distance > 70", name="new", replace=True)', 1.5),
    "filter of a database": ('lake.filter("num_objects > 200", name="new", database="all", replace=True)', 1.5),
    "filter with an order": (
        'lake.filter("num_objects > 200", name="new", order_by="ego_distance", replace=True)',
        0.0,
    ),
    "split 8:1:1": ('lake.split("all", {"a": 0.8, "b": 0.1, "c": 0.1}, replace=True)', 2.0),
    "split by source log": ('lake.split("all", {"a": 0.8, "b": 0.2}, by="source_log", replace=True)', 0.0),
    "split, stratified": (
        'lake.split("all", {"a": 0.8, "b": 0.2}, by="source_log", stratify="city", replace=True)',
        0.0,
    ),
    "merge of two": ('lake.merge("far", "busy", name="new", replace=True)', 2.0),
    "diff": ('lake.diff("far", "busy")', 2.0),
    "sample of 10,000": ('lake.sample("all", name="new", n=10_000, replace=True)', 0.0),
}
"""What is measured, each in a process of its own, and the seconds it may take."""

_PREPARE = """
import sys
from scenarionet_data import Lake
lake = Lake(sys.argv[1])
lake.filter(name="all")
lake.filter("ego_distance > 40", name="far")
lake.filter("num_objects > 60", name="busy")
"""

_OPEN_LOADER = """
import json, sys, time
from scenarionet_data import Lake, ScenarioLoader
lake = Lake(sys.argv[1])
database = eval(sys.argv[2])
started = time.process_time()
loader = ScenarioLoader(sys.argv[1], database)
cpu = time.process_time() - started
status = open("/proc/self/status").read()
print(json.dumps({"cpu": cpu, "peak_mb": int(status.split("VmHWM:")[1].split()[0]) / 1024}))
"""

_OPERATE = """
import json, statistics, sys, time, warnings
warnings.simplefilter("ignore")
from scenarionet_data import Lake
lake, took = Lake(sys.argv[1]), []
for k in range(4):
    started = time.perf_counter(), time.process_time()
    exec(sys.argv[2])
    took.append((time.perf_counter() - started[0], time.process_time() - started[1]))
    if k == 0:
        status = open("/proc/self/status").read()
wall, cpu = (statistics.median(times) for times in zip(*took))
print(json.dumps({"wall": wall, "cpu": cpu, "peak_mb": int(status.split("VmHWM:")[1].split()[0]) / 1024}))
"""


def figures() -> Iterator[Figure]:
    """Benchmarks for 100,000, 1,000,000 and 10,000,000 rows, the last in shards ten times as large."""
    for rows, shard_rows, wanted in (
        (100_000, _SHARD_ROWS, ("", "", "")),
        (1_000_000, _SHARD_ROWS, ("<= 0.3", "<= 0.5", "<= 300")),
        (10_000_000, 10 * _SHARD_ROWS, ("", "<= 1.5", "<= 600")),
    ):
        with tempfile.TemporaryDirectory() as folder:
            write_metadata_lake(Path(folder), rows, shard_rows)
            yield from filter_figures(folder, f"{rows // 1000} k rows", wanted)
            if rows >= 1_000_000:
                in_fresh_process(_PREPARE, folder)
                yield from loader_figures(folder, f"{rows // 1000} k rows")
                yield from operation_figures(folder, f"{rows // 1000} k rows")


def filter_figures(folder: str, name: str, wanted: tuple[str, str, str]) -> Iterator[Figure]:
    """Opening, filtering and counting; ``wanted`` are the goals for opening, filtering and memory."""
    found = json.loads(in_fresh_process(_FILTER, folder))
    yield Figure(f"{name}: open the lake, first time in a process", found["first_open"], "s", wanted[0])
    yield Figure(
        f"{name}: filter to a saved database of {found['members']}, first time in a process",
        found["first_filter"],
        "s",
        wanted[1],
        "ScenarioNet 50 s for 100 k",
    )
    yield Figure(f"{name}: filter to a saved database", found["filter"], "s", wanted[1])
    yield Figure(f"{name}: filter to a saved database, time of the processor", found["busy"], "s", wanted[1])
    yield Figure(f"{name}: count under a filter", found["count"], "s", "", "prototype 0.037 s")
    peak = "peak memory of the process"
    yield Figure(f"{name}: {peak}", found["peak_mb"], "MB", wanted[2], "ScenarioNet 3,800 MB for 100 k")


def loader_figures(folder: str, rows: str) -> Iterator[Figure]:
    """Opening a loader over every scenario, each kind of selection in a process of its own."""
    for name, database in (("the whole lake", "None"), ("ids", "list(lake.database('all'))"), ("a database", "'all'")):
        found = json.loads(in_fresh_process(_OPEN_LOADER, folder, database))
        yield Figure(f"{rows}: open a loader over {name}, time of the processor", found["cpu"], "s", "<= 1")
        yield Figure(f"{rows}: open a loader over {name}, peak memory", found["peak_mb"], "MB", "<= 500")


def operation_figures(folder: str, rows: str) -> Iterator[Figure]:
    """Time of the other operations; memory is that of the first run in a process."""
    for name, (code, seconds) in _OPERATIONS.items():
        found = json.loads(in_fresh_process(_OPERATE, folder, code))
        goal = f"<= {seconds:g}" if seconds else ""
        yield Figure(f"{rows}: {name}", found["wall"], "s", goal)
        yield Figure(f"{rows}: {name}, time of the processor", found["cpu"], "s", goal)
        yield Figure(f"{rows}: {name}, peak memory", found["peak_mb"], "MB", "<= 500" if seconds else "")


def write_metadata_lake(root: Path, rows: int, shard_rows: int = _SHARD_ROWS) -> None:
    """Write a lake with metadata only: real rows, random statistics, in files as conversion writes them."""
    files, rng = LocalLakeFiles(root), np.random.default_rng(0)
    row = dict(codec.encode(make_scenario(1), "1").metadata)
    row |= {f"{table}_num_rows": 1 for table in ("tracks", "lights", "maps")}
    row |= {"tracks_row_group": 0, "tracks_first_row": 0, "tracks_file": "tracks/none.parquet"}
    template = pa.Table.from_pylist([row] * shard_rows, schema=tables.load("metadata").schema)
    records = [_write_shard(files, template, number, rng) for number in range(rows // shard_rows)]
    listed = manifests.write(files, snapshots.EMPTY, records, frozenset())
    metadata = tuple(str(record.metadata_file) for record in records)
    snapshots.publish(files, Snapshot(1, snapshots.now(), "benchmark", metadata, listed))
    commits.consolidate(files)


def _write_shard(files: LakeFiles, template: pa.Table, number: int, rng: np.random.Generator) -> ShardRecord:
    name = f"training.tfrecord-{number:05d}-of-02000"
    rows = template.num_rows
    columns = {
        "scenario_id": [f"waymo/v1.2/{value:016x}" for value in rng.integers(0, 2**63, rows)],
        "content_hash": rng.integers(0, 2**63, rows).astype(np.uint64),
        "source_log": [f"segment-{value:05d}" for value in rng.integers(0, 50_000, rows)],
        "ego_distance": rng.gamma(2.0, 40.0, rows).astype(np.float32),
        "num_objects": rng.gamma(2.0, 50.0, rows).astype(np.int32),
        "tracks_row_group": (np.arange(rows) % 64).astype(np.int32),
    }
    table = template
    for column, values in columns.items():
        index = table.schema.get_field_index(column)
        table = table.set_column(index, table.schema.field(index), pa.array(values, table.schema.field(index).type))
    metadata_file = f"{partition('metadata', 'waymo', 'v1.2', 'train')}/{name}-0.parquet"
    publish_table(files, "metadata", table, {}, metadata_file)
    tracks = [f"{partition('tracks', 'waymo', 'v1.2', 'train')}/{name}-{part:03d}-0.parquet" for part in range(8)]
    return ShardRecord(
        key=f"{number:016x}",
        dataset="waymo",
        version="v1.2",
        split="train",
        name=name,
        options="{}",
        converter_version="1",
        schemas=tables.content_tag(),
        max_scenarios=None,
        items=[name],
        fingerprints=["0"],
        num_scenarios=rows,
        num_quarantined=0,
        metadata_file=metadata_file,
        files=tracks,
        sizes=[0] * len(tracks),
        checksums=["0"] * len(tracks),
    )
