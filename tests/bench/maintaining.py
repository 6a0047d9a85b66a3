"""Maintenance: cost and benefit of compacting 1,000 scenarios of real size in each profile, and of checking."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.maintenance import compact, fsck, vacuum
from tests.bench.measure import Figure
from tests.bench.mining import recorded_lake

_PER_SHARD = 10
_TABLES = ("tracks", "lights", "maps", "metadata")
_SPEED = "SELECT scenario_id, avg(speed) AS speed FROM ego_states GROUP BY scenario_id"
_OBJECTS = "SELECT object_type, avg(length[1]), max(start) FROM tracks GROUP BY object_type"


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over the recorded scenarios under new ids in shards of 10 (written ones if there are none)."""
    with tempfile.TemporaryDirectory() as folder:
        root = recorded_lake(Path(folder), recordings, _PER_SHARD).root
        yield from _state(root, "as converted")
        for profile in ("analytics", "training"):
            started = time.process_time()
            done = compact(root, profile)
            took = 1e3 * (time.process_time() - started) / done.scenarios
            yield Figure(f"compact: rewrite for {profile}, per scenario (CPU)", took, "ms")
            yield from _state(root, f"for {profile}")
        for is_deep in (False, True):
            took = _cpu(lambda is_deep=is_deep: fsck(root, is_deep=is_deep))
            yield Figure(f"fsck{' --deep' if is_deep else ''}: 3 snapshots of 1,000 scenarios (CPU)", took, "s")
        yield Figure("vacuum --keep-last 1 (CPU)", _cpu(lambda: vacuum(root, keep_last=1), 1), "s")


def _state(root: Path, name: str) -> Iterator[Figure]:
    """Time to read a lake in its current state."""
    lake = Lake(root)
    paths = [path for table in _TABLES for path in lake.paths(table)]
    yield Figure(f"{name}: files", len(paths), "")
    yield Figure(f"{name}: bytes", sum(Path(path).stat().st_size for path in paths) / 1e6, "MB")
    yield Figure(f"{name}: SQL, speed of every ego (CPU)", _cpu(lambda: Lake(root).sql(_SPEED)), "s")
    yield Figure(f"{name}: SQL, two columns of every object (CPU)", _cpu(lambda: Lake(root).sql(_OBJECTS)), "s")
    loader = ScenarioLoader(lake)
    order = [int(k) for k in np.random.default_rng(0).permutation(len(loader))]
    for what, load in (
        ("tracks of one random scenario", lambda k: loader.tracks(order[k])),
        ("one whole random scenario", lambda k: loader[order[k]]),
        ("one whole scenario, in order", lambda k: loader[k]),
        ("64 whole random scenarios as a batch", lambda k: loader.batch(order[64 * k : 64 * k + 64])),
    ):
        repeats = 8 if "batch" in what else 200
        yield Figure(f"{name}: {what} (CPU)", 1e3 * _mean(load, repeats), "ms")


def _mean(load: Callable[[int], object], repeats: int) -> float:
    """Mean CPU time of a load [s]: of scenarios that share a row group, one pays for all."""
    for k in range(3):
        load(k)
    started = time.process_time()
    for k in range(repeats):
        load(k)
    return (time.process_time() - started) / repeats


def _cpu(action: Callable[[], object], repeats: int = 5) -> float:
    """Median CPU time [s]."""
    times = []
    for _ in range(repeats):
        started = time.process_time()
        action()
        times.append(time.process_time() - started)
    return median(times)
