"""Packing 1 % of 1,000 scenarios of real size: written bytes, and time."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from statistics import median

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import Lake
from scenarionet_data.packs.verifying import verify_pack
from tests.bench.measure import Figure
from tests.bench.mining import recorded_lake

_REPEATS = 3


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over the recorded scenarios under new ids (written ones if there are none)."""
    with tempfile.TemporaryDirectory() as folder:
        lake = recorded_lake(Path(folder), recordings)
        whole = sum(path.stat().st_size for path in lake.root.rglob("*") if path.is_file())
        out = Path(folder) / "pack"
        for percent, wanted in ((1, "<= 1.2"), (10, "<= 10.2")):
            drawn = lake.sample(None, name=f"sample{percent}", fraction=percent / 100)
            members = lake.resolve(drawn)[1]
            alone = sum(_stored(lake, members, table) for table in ("tracks", "lights", "maps"))
            took = []
            for _ in range(_REPEATS):
                shutil.rmtree(out, ignore_errors=True)
                started = time.process_time()
                packed = lake.pack(drawn, out)
                took.append(time.process_time() - started)
            held = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
            yield Figure(f"pack: bytes for {percent} % of the scenarios", 100 * held / whole, "%", wanted)
            yield Figure(f"pack: of these, around the members' pages ({percent} %)", (held - alone) / 1e3, "kB")
            yield Figure(f"pack: a scenario, read back ({percent} %)", 1e3 * median(took) / packed.num_scenarios, "ms")
        started = time.process_time()
        verify_pack(out)
        yield Figure("pack: verify, per scenario", 1e3 * (time.process_time() - started) / packed.num_scenarios, "ms")


def _stored(lake: Lake, members: pa.Table, table: str) -> int:
    """Bytes of the members' pages in a table."""
    footer = cache(lambda name: pq.read_metadata(lake.files.path(name)))
    total = 0
    for name, number in zip(
        members[f"{table}_file"].to_pylist(), members[f"{table}_row_group"].to_pylist(), strict=True
    ):
        if name is not None:
            group = footer(name).row_group(number)
            total += sum(group.column(k).total_compressed_size for k in range(group.num_columns))
    return total
