"""Loading from an S3 server on loopback: requests of a scenario, and what fetching a batch together gains."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from tests.bench.converting import waymo_raw
from tests.bench.measure import Figure
from tests.fixtures import object_store
from tests.fixtures.object_store import ObjectStore

_COUNT = 400
_BATCH = 64
_LATENCIES = (0.0, 0.01, 0.02, 0.05)
"""Seconds that the server waits before each answer: none, what the quickest stores take, and those farther away."""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Figures over 400 Waymo scenarios (the recorded one under new ids, where it is at hand)."""
    with tempfile.TemporaryDirectory() as folder, object_store.serve() as store:
        os.environ.update(store.environment | {"SCENARIONET_CACHE": f"{folder}/cache"})
        url = f"s3://{object_store.BUCKET}/lake"
        convert("waymo", str(waymo_raw(Path(folder) / "raw", recordings, _COUNT)), url)
        loader = ScenarioLoader(Lake(url))
        loader.batch(range(_COUNT))  # footers known, code compiled
        order = np.random.default_rng(0).permutation(_COUNT)
        store.set()
        for index in order[:20].tolist():
            loader[index]
        yield Figure("remote: requests of a random scenario", len(store.requests()) / 20, "requests", "<= 3")
        store.set()
        loader.batch(order[:_BATCH].tolist())
        yield Figure("remote: requests of 64 random scenarios as a batch", len(store.requests()), "requests")
        for latency in _LATENCIES:
            store.set(latency=latency)
            yield from _ratio(loader, latency)
        store.set(latency=_LATENCIES[-1])
        yield from _sql(url, store)


def _ratio(loader: ScenarioLoader, latency: float) -> Iterator[Figure]:
    """64 random scenarios one by one and as a batch, in turns."""
    rounds = [np.random.default_rng(k).permutation(_COUNT)[:_BATCH].tolist() for k in range(5)]
    single = [_seconds(lambda chosen=chosen: [loader[index] for index in chosen]) for chosen in rounds]
    batch = [_seconds(lambda chosen=chosen: loader.batch(chosen)) for chosen in rounds]
    one, together = statistics.median(single), statistics.median(batch)
    where = f"{1e3 * latency:.0f} ms away"
    yield Figure(f"remote: a random scenario, {where}", 1e3 * one / _BATCH, "ms")
    yield Figure(f"remote: 64 random scenarios as a batch, {where}", 1e3 * together, "ms")
    wanted = ">= 5" if latency else ""  # beside the server there is nothing to wait for, and decoding takes the time
    yield Figure(f"remote: a batch of 64 against one by one, {where}", one / together, "times", wanted)


def _sql(url: str, store: ObjectStore) -> Iterator[Figure]:
    query = "SELECT scenario_id, avg(list_avg(vx)) AS vx FROM tracks GROUP BY ALL"
    lake = Lake(url)
    taken = _seconds(lambda: lake.sql(query))
    where = f"{1e3 * _LATENCIES[-1]:.0f} ms away"
    yield Figure(
        f"remote: SQL over a column of every track, {where}", 1e3 * taken, "ms", "", f"{len(store.requests())} requests"
    )


def _seconds(action: Callable[[], Any]) -> float:
    started = time.perf_counter()
    action()
    return time.perf_counter() - started
