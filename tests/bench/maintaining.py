"""Maintenance: cost and benefit of compacting 1,000 scenarios of real size in each profile, and of checking."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.building import MapBuilder
from scenarionet_data.databases.record import Lineage
from scenarionet_data.databases.writer import save
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.maintenance import compact, fsck, vacuum
from scenarionet_data.query.lake_view import open_view
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.write.map_tiles import write_shared_map
from tests.bench.measure import Figure
from tests.bench.mining import recorded_lake
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import make_scenario, renamed

_PER_SHARD = 10
_SNAPSHOTS = 5000
_DATABASES = 10_000
_TABLES = ("tracks", "lights", "maps", "metadata")
_SPEED = "SELECT scenario_id, avg(speed) AS speed FROM ego_states GROUP BY scenario_id"
_OBJECTS = "SELECT object_type, avg(length[1]), max(start) FROM tracks GROUP BY object_type"


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over the recorded scenarios under new ids in shards of 10 (written ones if there are none)."""
    with tempfile.TemporaryDirectory() as folder:
        root = recorded_lake(Path(folder), recordings, _PER_SHARD).root
        yield from _state(root, "as converted")
        for profile in ("analytics", "archive", "training"):
            started = time.process_time()
            done = compact(root, profile)
            took = 1e3 * (time.process_time() - started) / done.scenarios
            yield Figure(f"compact: rewrite for {profile}, per scenario (CPU)", took, "ms")
            yield from _state(root, f"for {profile}")
        for is_deep in (False, True):
            took = _cpu(lambda is_deep=is_deep: fsck(root, is_deep=is_deep))
            yield Figure(f"fsck{' --deep' if is_deep else ''}: 3 snapshots of 1,000 scenarios (CPU)", took, "s")
        yield Figure("vacuum --keep-last 1 (CPU)", _cpu(lambda: vacuum(root, keep_last=1), 1), "s")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "lake"
        write_history(root, _SNAPSHOTS)
        yield Figure(f"fsck: {_SNAPSHOTS:,} snapshots (CPU)", _cpu(lambda: fsck(root), 1), "s")
        yield Figure(f"vacuum: {_SNAPSHOTS:,} snapshots (CPU)", _cpu(lambda: vacuum(root, keep_last=10), 1), "s")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "lake"
        write_history(root, 1)
        write_databases(root, _DATABASES)
        yield Figure(f"fsck: {_DATABASES:,} databases (CPU)", _cpu(lambda: fsck(root), 1), "s")


def write_history(root: Path, count: int) -> None:
    """Commit scenarios in 64 shards, then shared maps, one a snapshot."""
    files = open_files(root)
    scenario = make_scenario(1, num_objects=1, num_steps=2, num_lanes=1, num_lights=0)
    shards = [write_shard(root, [renamed(scenario, f"s{k}")], name=f"s{k}") for k in range(64)]
    commits.commit(files, shards, "bench")
    for number in range(1, count):
        item = RawItem(f"city{number}", "0")
        shard = Shard(scenario.dataset, scenario.version, "", f"city{number}", "/raw", (item,), Options())
        features = MapBuilder()
        features.add("lane", MapFeatureType.LANE_SURFACE_STREET, polyline=np.zeros((2, 3)))
        commits.commit(files, [write_shared_map(files, shard, features, "1", "CC0")], "bench")


def write_databases(root: Path, count: int) -> None:
    """Save databases of 20 members each."""
    view = open_view(root)
    members = view.engine.arrow("SELECT scenario_id, 1.0::DOUBLE AS weight, content_hash FROM metadata LIMIT 20")
    lineage = Lineage("filter", "SELECT 1", {}, [], view.snapshot.number, "2020-01-01T00:00:00+00:00", 20)
    for number in range(count):
        save(view.files, f"d{number}", members, lineage, replace=False)


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
