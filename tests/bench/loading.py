"""Loading: one scenario's tracks, a whole scenario, a batch, and a query that reads all tracks."""

from __future__ import annotations

import gc
import pickle
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.export import export
from scenarionet_data.storage.read.parquet import page_kernels as kernels
from scenarionet_data.storage.read.row_groups import RowGroupAddress
from scenarionet_data.storage.read.scenario_reader import TABLES
from tests.bench.converting import waymo_raw
from tests.bench.measure import Figure, median_ms

_COUNT = 400


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over 400 Waymo scenarios (the recorded one under new ids, if available)."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        raw = waymo_raw(root / "raw", recordings, _COUNT)
        convert("waymo", str(raw), root / "lake")
        lake = Lake(root / "lake")
        loader = ScenarioLoader(lake)
        opened = median_ms(lambda _: ScenarioLoader(str(lake.root), [loader.scenario_ids[7]]), 9)
        yield Figure("load: open a loader over one scenario", opened, "ms", "<= 15")
        yield from _whole(loader, root)
        order = np.random.default_rng(0).integers(len(loader), size=1000)
        for index in range(len(loader)):  # warm: files in the page cache, footers read
            loader.tracks(index)
        one = median_ms(lambda k: loader.tracks(int(order[k])), 300)
        yield Figure("load: tracks of one random scenario, warm", one, "ms", "<= 2", "pickle 2.2-2.6 ms")
        whole = median_ms(lambda k: loader[int(order[k])], 300)
        yield Figure("load: one whole random scenario, warm", whole, "ms", "<= 3", "pickle 1.2-4 ms + 1.3-4 to centre")
        batch = median_ms(lambda k: loader.batch_tracks(order[64 * k : 64 * k + 64].tolist()), 9)
        yield Figure("load: tracks of 64 random scenarios as a batch", batch, "ms", "<= 120", "prototype 173 ms")
        batch = median_ms(lambda k: loader.batch(order[64 * k : 64 * k + 64].tolist()), 9)
        yield Figure("load: 64 whole random scenarios as a batch", batch, "ms")
        yield Figure("sql: average speed of every scenario's ego", _ego_speed(lake), "ms", "", "prototype 145 ms")


def _whole(loader: ScenarioLoader, root: Path) -> Iterator[Figure]:
    """Whole scenarios against bare pickles of them, and against decompressing the pages that they are read from.

    The pickles are those that ``export`` writes; all files are in the page cache, and the garbage collector is off.
    Times are those of the processor, in alternation.
    """
    export((loader[index] for index in range(8)), root / "pickles")
    paths = sorted((root / "pickles").glob("sd_*.pkl"))
    for index in range(80):  # more than the loader leaves to Arrow
        loader[index]
    pages = [_pages(loader, index) for index in range(8)]
    actions: dict[str, Callable[[int], object]] = {
        "ours": lambda k: loader[k],
        "pickle": lambda k: pickle.loads(paths[k].read_bytes()),
        "floor": lambda k: [codec.decompress(page, size) for page, codec, size in pages[k]],
    }
    times: dict[str, list[float]] = {name: [] for name in actions}
    gc.disable()
    for _ in range(30):
        for name, action in actions.items():
            started = time.process_time()
            for k in range(8):
                action(k)
            times[name].append((time.process_time() - started) / 8)
    gc.enable()
    ours, pickled, floor = (statistics.median(times[name]) for name in actions)
    yield Figure("load: a whole scenario, time of the processor", 1e3 * ours, "ms")
    yield Figure("load: its exported pickle against it", pickled / ours, "times", ">= 2")
    yield Figure("load: it against decompressing its pages", ours / floor, "times", "<= 2.5")


def _pages(loader: ScenarioLoader, index: int) -> list[tuple[pa.Buffer, pa.Codec, int]]:
    """Stored pages of the columns that a scenario is decoded from, with their codec and size."""
    reader, found = loader._reader, []
    codecs = {kernels.ZSTD: pa.Codec("zstd"), kernels.LZ4: pa.Codec("lz4_raw")}
    for table in TABLES:
        address = RowGroupAddress(table, *(loader._rows[index][f"{table}_{part}"] for part in ("file", "row_group")))
        if address.file is None:
            continue
        (group,) = reader._row_groups.get([address])
        for chunk in group.footer.chunks(group.number).tolist():
            first, data, end = (
                chunk[part] - group.base for part in (kernels.CHUNK_START, kernels.DATA_START, kernels.CHUNK_END)
            )
            spans = [(first, data), (data, end)] if first < data else [(data, end)]
            for start, stop in spans if end > 0 else []:
                size, stored = (int(value) >> 1 for value in _varints(group.content[start : start + 16].tolist())[1:3])
                found.append((pa.py_buffer(group.content[stop - stored : stop]), codecs[chunk[kernels.CODEC]], size))
    return found


def _varints(header: list[int]) -> list[int]:
    """The first numbers of a page header, each behind a byte: type, size, stored size."""
    values, at = [], 0
    while len(values) < 3:
        at, value, shift = at + 1, 0, 0
        while True:
            value |= (header[at] & 127) << shift
            at, shift = at + 1, shift + 7
            if header[at - 1] < 128:
                break
        values.append(value)
    return values


def _ego_speed(lake: Lake) -> float:
    query = """
        SELECT scenario_id, avg(speed) AS speed
        FROM states JOIN metadata USING (scenario_id)
        WHERE track_id = ego_id
        GROUP BY scenario_id
    """
    times = []
    for _ in range(5):
        started = time.perf_counter()
        assert len(lake.sql(query)) == _COUNT
        times.append(time.perf_counter() - started)
    return 1e3 * statistics.median(times)
