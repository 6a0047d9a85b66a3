"""Loading from an S3 server on loopback: requests per scenario, and the gain of fetching a batch together."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from tests.bench import range_server
from tests.bench.converting import waymo_raw
from tests.bench.measure import Figure
from tests.fixtures import object_store
from tests.fixtures.object_store import ObjectStore

_COUNTS = (200, 400)
"""Scenarios to choose from: the more there are, the farther 64 random ones lie apart."""
_BATCH = 64
_LATENCIES = (0.0, 0.01, 0.02, 0.05)
"""Seconds that the server waits before each answer: none, what the quickest stores take, and those farther away."""
_OF_SAMPLES = 0.02
"""Seconds for samples of two workers."""
_WORKER = """
import sys, time, warnings
import numpy as np
from scenarionet_data import Samples, Targets, TimeWindow
warnings.simplefilter("ignore")
samples = Samples(sys.argv[1], window=TimeWindow(stride=1.0), targets=Targets("moving"))
rng, targets = np.random.default_rng(int(sys.argv[2])), int(sys.argv[3])
places = samples.places
numbers = [np.flatnonzero(places == place) for place in np.unique(places)]
batches = [
    np.concatenate([rng.choice(numbers[k], targets) for k in rng.integers(0, len(numbers), 32 // targets)])
    for _ in range(60)
]
for number, batch in enumerate(batches[:-1]):
    if number == 9:  # footers are known, code is compiled
        started = time.perf_counter()
    samples.prefetch(batches[number + 1])
    samples.batch(batch)
print(50 * 32 / (time.perf_counter() - started))
"""
"""A worker of a loader for training: each batch is requested while the one before is made."""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over Waymo scenarios (the recorded one under new ids, if available)."""
    with tempfile.TemporaryDirectory() as folder, object_store.serve() as store:
        os.environ.update(store.environment | {"SCENARIONET_CACHE": f"{folder}/cache"})
        for count in _COUNTS:
            url = f"s3://{object_store.BUCKET}/lake-{count}"
            convert("waymo", str(waymo_raw(Path(folder) / f"raw-{count}", recordings, count)), url)
            yield from _requests(url, count, store)
            for latency in _LATENCIES:
                store.set(latency=latency)
                yield from _ratio(url, count, latency)
            store.set()
        store.set(latency=_LATENCIES[-1])
        yield from _sql(url, store)
        convert("waymo", f"{folder}/raw-{_COUNTS[0]}", f"{folder}/bucket/lake")
        for targets in (1, 8):
            yield _samples(Path(folder), targets)


def _requests(url: str, count: int, store: ObjectStore) -> Iterator[Figure]:
    """Number of requests to the server."""
    loader = ScenarioLoader(Lake(url))
    loader.batch(range(count))  # footers known, code compiled
    order = np.random.default_rng(0).permutation(count).tolist()
    store.set()
    for index in order[:20]:
        loader[index]
    yield Figure(f"remote: requests of a random scenario of {count}", len(store.requests()) / 20, "requests", "<= 3")
    store.set()
    loader.batch(order[:_BATCH])
    name = f"remote: requests of 64 random scenarios of {count} as a batch"
    yield Figure(name, len(store.requests()), "requests")


def _ratio(url: str, count: int, latency: float) -> Iterator[Figure]:
    """64 random scenarios individually and as a batch, in alternation."""
    loader = ScenarioLoader(Lake(url))  # sees how far away the store is
    loader.batch(range(count))
    rounds = [np.random.default_rng(k).permutation(count)[:_BATCH].tolist() for k in range(5)]
    single, batch = [], []
    for chosen in rounds:
        single.append(_seconds(lambda chosen=chosen: [loader[index] for index in chosen]))
        batch.append(_seconds(lambda chosen=chosen: loader.batch(chosen)))
    one, together = statistics.median(single), statistics.median(batch)
    where = f"of {count}, {1e3 * latency:.0f} ms away"
    # Beside the server 64 of 400 take its processor for 34 requests, which nothing hides.
    wanted = ">= 5" if count == _COUNTS[0] or latency else ""
    yield Figure(f"remote: a random scenario {where}", 1e3 * one / _BATCH, "ms")
    yield Figure(f"remote: 64 random scenarios as a batch {where}", 1e3 * together, "ms")
    yield Figure(f"remote: a batch of 64 against one by one {where}", one / together, "times", wanted)


def _sql(url: str, store: ObjectStore) -> Iterator[Figure]:
    query = "SELECT scenario_id, avg(list_avg(vx)) AS vx FROM tracks GROUP BY ALL"
    lake = Lake(url)
    taken = _seconds(lambda: lake.sql(query))
    where = f"{1e3 * _LATENCIES[-1]:.0f} ms away"
    yield Figure(
        f"remote: SQL over a column of every track, {where}", 1e3 * taken, "ms", "", f"{len(store.requests())} requests"
    )


def _samples(folder: Path, targets: int) -> Figure:
    """Samples of random scenarios by two workers at once, beside a server that takes little of their processors."""
    command = [sys.executable, "-m", "tests.bench.range_server", str(folder / "bucket"), str(_OF_SAMPLES)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdin and server.stdout
        environment = os.environ | {"AWS_ENDPOINT_URL": server.stdout.readline().strip()}
        worker = [sys.executable, "-c", _WORKER, f"s3://{range_server.BUCKET}/lake"]
        running = [
            subprocess.Popen([*worker, seed, str(targets)], stdout=subprocess.PIPE, text=True, env=environment)
            for seed in "01"
        ]
        rate = sum(float(process.communicate()[0]) for process in running)
        server.stdin.close()
        taken = float(server.stdout.readline())
    name = f"remote: samples by two workers, {targets} of a random scenario, {1e3 * _OF_SAMPLES:.0f} ms away"
    return Figure(name, rate, "samples/s", ">= 500", f"server {taken:.1f} s of a processor")


def _seconds(action: Callable[[], Any]) -> float:
    started = time.perf_counter()
    action()
    return time.perf_counter() - started
