"""A million scenarios: opening, filtering and saving over a metadata table as 2,000 converted shards leave it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from scenarionet_data import codec, tables
from scenarionet_data.store import commit as commits
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.shard_record import ShardRecord, partition
from scenarionet_data.store.table_file import write_table
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
opens, filters, counts = [], [], []
for k in range(5):
    started = time.perf_counter()
    lake = Lake(sys.argv[1])
    opens.append(time.perf_counter() - started)
    started = time.perf_counter()
    database = lake.filter("ego_distance > 10 AND num_objects > 200", name=f"busy{k}")
    filters.append(time.perf_counter() - started)
    started = time.perf_counter()
    lake.sql("SELECT count(*) FROM metadata WHERE ego_distance > 10 AND num_objects > 200")
    counts.append(time.perf_counter() - started)
print(json.dumps({
    "import": imported, "open": statistics.median(opens), "first_open": opens[0],
    "first_filter": first, "filter": statistics.median(filters), "count": statistics.median(counts),
    "members": len(database), "peak_mb": peak_mb,
    "bytes": (lake.root / "databases" / database.name / "1.parquet").stat().st_size,
}))
"""


def figures() -> Iterator[Figure]:
    """Figures for 100,000 and 1,000,000 rows."""
    for rows, wanted in ((100_000, ("", "", "")), (1_000_000, ("<= 0.3", "<= 0.5", "<= 300"))):
        with tempfile.TemporaryDirectory() as folder:
            write_metadata_lake(Path(folder), rows)
            found = json.loads(in_fresh_process(_FILTER, folder))
        name = f"{rows // 1000} k rows"
        yield Figure(f"{name}: open the lake, first time in a process", found["first_open"], "s", wanted[0])
        yield Figure(
            f"{name}: filter to a saved database of {found['members']}, first time in a process",
            found["first_filter"],
            "s",
            wanted[1],
            "ScenarioNet 50 s for 100 k",
        )
        yield Figure(f"{name}: filter to a saved database", found["filter"], "s", wanted[1])
        yield Figure(f"{name}: count under a filter", found["count"], "s", "", "prototype 0.037 s")
        yield Figure(
            f"{name}: peak memory of the process",
            found["peak_mb"],
            "MB",
            wanted[2],
            "ScenarioNet 3,800 MB for 100 k",
        )


def write_metadata_lake(root: Path, rows: int) -> None:
    """A lake of metadata alone: real rows, random statistics, committed shard by shard as conversion does."""
    files, rng = LakeFiles(root), np.random.default_rng(0)
    row = dict(codec.encode(make_scenario(1), "1").metadata)
    row |= {f"{table}_num_rows": 1 for table in ("tracks", "lights", "maps")}
    row |= {"tracks_row_group": 0, "tracks_first_row": 0, "tracks_file": "tracks/none.parquet"}
    template = pa.Table.from_pylist([row] * _SHARD_ROWS, schema=tables.load("metadata").schema)
    records = [_write_shard(files, template, number, rng) for number in range(rows // _SHARD_ROWS)]
    for first in range(0, len(records), 200):
        commits.commit(files, records[first : first + 200], "benchmark")
    commits.consolidate(files)


def _write_shard(files: LakeFiles, template: pa.Table, number: int, rng: np.random.Generator) -> ShardRecord:
    name = f"training.tfrecord-{number:05d}-of-02000"
    columns = {
        "scenario_id": [f"waymo/v1.2/{value:016x}" for value in rng.integers(0, 2**63, _SHARD_ROWS)],
        "content_hash": rng.integers(0, 2**63, _SHARD_ROWS).astype(np.uint64),
        "ego_distance": rng.gamma(2.0, 40.0, _SHARD_ROWS).astype(np.float32),
        "num_objects": rng.gamma(2.0, 50.0, _SHARD_ROWS).astype(np.int32),
        "tracks_row_group": (np.arange(_SHARD_ROWS) % 64).astype(np.int32),
    }
    table = template
    for column, values in columns.items():
        index = table.schema.get_field_index(column)
        table = table.set_column(index, table.schema.field(index), pa.array(values, table.schema.field(index).type))
    metadata_file = f"{partition('metadata', 'waymo', 'v1.2', 'train')}/{name}-0.parquet"
    files.publish(write_table(files, "metadata", table, {}), metadata_file)
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
        num_scenarios=_SHARD_ROWS,
        num_quarantined=0,
        metadata_file=metadata_file,
        files=tracks,
        sizes=[0] * len(tracks),
        checksums=["0"] * len(tracks),
    )
