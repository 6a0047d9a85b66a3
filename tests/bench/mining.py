"""Queries on events inside 1,000 scenarios of real size: states, pedestrians near the ego, every event."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.query.named_sql import EVENTS
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from tests.bench.converting import waymo_raw
from tests.bench.measure import Figure
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import renamed

_COUNT = 1000
_SOURCES = {
    "waymo": "waymo/training",
    "argoverse2": "argoverse2/motion-forecasting/val",
    "scenarionet": "scenarionet",
}
_EGO_SPEED = "SELECT scenario_id, avg(speed) AS speed FROM ego_states GROUP BY scenario_id"
_PEDESTRIANS = """
    SELECT p.scenario_id, p.track_id, timestep
    FROM states AS p JOIN ego_states AS e USING (scenario_id, timestep)
    WHERE p.object_type = 'PEDESTRIAN' AND (p.x - e.x) ** 2 + (p.y - e.y) ** 2 < 20 ** 2
"""
_WANTED = {"cut_in": "<= 5"}


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks over the recorded scenarios under new ids (written ones if there are none)."""
    with tempfile.TemporaryDirectory() as folder:
        lake = recorded_lake(Path(folder), recordings)
        states = float(lake.sql("SELECT sum(num_states) FROM metadata").item())
        yield Figure(f"mine: states of {_COUNT} scenarios", states, "")
        yield Figure("mine: mean speed of every ego", _seconds(lambda: lake.sql(_EGO_SPEED)), "s", "<= 0.3")
        yield Figure("mine: pedestrians within 20 m of the ego", _seconds(lambda: lake.sql(_PEDESTRIANS)), "s", "<= 1")
        for name in EVENTS.names():
            took = _seconds(lambda name=name: lake.mine(name))
            yield Figure(f"mine: {name}", took, "s", _WANTED.get(name, ""))


def recorded_lake(root: Path, recordings: Path | None, per_shard: int = 100) -> Lake:
    """1,000 scenarios of real size."""
    sources = {name: recordings / folder for name, folder in _SOURCES.items()} if recordings else {}
    for name, raw in (sources or {"waymo": waymo_raw(root / "raw", None, 16)}).items():
        convert(name, str(raw), root / "recorded")
    loader = ScenarioLoader(root / "recorded")
    recorded = [loader[index] for index in range(len(loader))]
    shards = [
        write_shard(root / "lake", [_copy(recorded, k) for k in range(first, first + per_shard)], f"part{first}")
        for first in range(0, _COUNT, per_shard)
    ]
    commits.commit(LocalLakeFiles(root / "lake"), shards, "benchmark")
    return Lake(root / "lake")


def _copy(recorded: list[ScenarioDescription], number: int) -> ScenarioDescription:
    original = recorded[number % len(recorded)]
    return renamed(replace(original, dataset="bench", version="v1", split="train"), f"r{number:04d}")


def _seconds(action) -> float:
    """Median wall time of three runs, after one to warm up."""
    took = []
    for _ in range(4):
        started = time.perf_counter()
        action()
        took.append(time.perf_counter() - started)
    return median(took[1:])
