"""Loading: one scenario's tracks, a whole scenario, a batch, and a query that reads all tracks."""

from __future__ import annotations

import pickle
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.export import export
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
        yield Figure("load: the same scenario's exported pickle, warm, in this run", _pickle(loader, root), "ms")
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


def _pickle(loader: ScenarioLoader, root: Path) -> float:
    """Time to load a whole scenario from a pickle on this machine, the reference for other figures."""
    export((loader[index] for index in range(8)), root / "pickles")
    paths = sorted((root / "pickles").glob("sd_*.pkl"))
    return median_ms(lambda k: pickle.loads(paths[k % len(paths)].read_bytes()), 100)


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
