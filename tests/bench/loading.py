"""Loading: one scenario's tracks, a whole scenario, a batch, and a query that reads all tracks."""

from __future__ import annotations

import gc
import os
import pickle
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.export import export
from scenarionet_data.storage.read.parquet import page_kernels as kernels
from scenarionet_data.storage.read.scenario_reader import TABLES, RowGroupAddress
from tests.bench.converting import waymo_raw
from tests.bench.measure import Figure, median_ms

_COUNT = 400
_CODECS = {kernels.ZSTD: pa.Codec("zstd"), kernels.LZ4: pa.Codec("lz4_raw")}


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
        yield from _whole(loader, root, "Waymo")
        if recordings:
            convert("argoverse2", str(recordings / "argoverse2" / "motion-forecasting"), root / "argoverse2")
            yield from _whole(ScenarioLoader(root / "argoverse2"), root, "Argoverse 2")
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


def _whole(loader: ScenarioLoader, root: Path, name: str) -> Iterator[Figure]:
    """Eight scenarios in a row against bare pickles of them, and against reading and decompressing the same bytes.

    The pickles are those that ``export`` writes, each read from its file. The floor reads the row groups of a scenario
    from files that are open already, as the loader's are, with one ``pread`` each, and decompresses the pages of the
    columns that a scenario is decoded from, with Arrow's LZ4 and zstd; nothing is verified or decoded. All files are in
    the page cache, and the garbage collector is off. Times are those of the processor, in alternation.
    """
    count = min(8, len(loader))
    export((loader[index] for index in range(count)), root / f"{name}-pickles")
    paths = sorted((root / f"{name}-pickles").glob("sd_*.pkl"))
    for index in range(80):  # more than the loader leaves to Arrow
        loader[index % count]
    stored = [_stored(loader, index) for index in range(count)]
    actions: dict[str, Callable[[int], object]] = {
        "ours": lambda k: loader[k],
        "pickle": lambda k: pickle.loads(paths[k].read_bytes()),
        "floor": lambda k: [group.decompress() for group in stored[k]],
    }
    times: dict[str, list[float]] = {action: [] for action in actions}
    gc.disable()
    for _ in range(30):
        for action, run in actions.items():
            started = time.process_time()
            for k in range(8):
                run(k % count)
            times[action].append((time.process_time() - started) / 8)
    gc.enable()
    ours, pickled, floor = (statistics.median(times[action]) for action in actions)
    yield Figure(f"load: a whole {name} scenario, time of the processor", 1e3 * ours, "ms")
    yield Figure(f"load: {name}, its exported pickle against it", pickled / ours, "times", ">= 2")
    yield Figure(f"load: {name}, it against reading and decompressing its pages", ours / floor, "times", "<= 2.5")


class _StoredGroup:
    """A row group in a file that is open, and the places of its pages.

    Args:
        path: The file.
        chunks: Column chunks, see ``page_kernels``.
        content: Bytes of the file.
    """

    def __init__(self, path: Path, chunks: list[list[int]], content: np.ndarray[Any, Any]) -> None:
        present = [chunk for chunk in chunks if chunk[kernels.CHUNK_END]]
        self._file = os.open(path, os.O_RDONLY)
        self._start = min(chunk[kernels.CHUNK_START] for chunk in present)
        self._size = max(chunk[kernels.CHUNK_END] for chunk in present) - self._start
        self._pages: list[tuple[int, int, pa.Codec, int]] = []
        for chunk in present:
            first, data, end = (chunk[part] for part in (kernels.CHUNK_START, kernels.DATA_START, kernels.CHUNK_END))
            for start, stop in [(first, data), (data, end)] if first < data else [(data, end)]:
                size, stored = (int(value) >> 1 for value in _varints(content[start : start + 16].tolist())[1:3])
                self._pages.append((stop - stored - self._start, stored, _CODECS[chunk[kernels.CODEC]], size))

    def decompress(self) -> list[pa.Buffer]:
        """Read the row group and decompress its pages."""
        content = pa.py_buffer(os.pread(self._file, self._size, self._start))
        return [codec.decompress(content.slice(at, stored), size) for at, stored, codec, size in self._pages]

    def __del__(self) -> None:
        os.close(self._file)


def _stored(loader: ScenarioLoader, index: int) -> list[_StoredGroup]:
    """The row groups of a scenario."""
    reader, row = loader._reader, loader._rows[index]
    found = []
    for table in TABLES:
        address = RowGroupAddress(table, row[f"{table}_file"], row[f"{table}_row_group"])
        if address.file is not None:
            (group,) = reader._row_groups.get([address])
            path = loader._files.path(address.file)
            found.append(_StoredGroup(path, group.footer.stored(group.number).chunks.tolist(), group.content))
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
