"""Samples for forecasting: per second of one core's processor time, maps included, beside trajdata and UniTraj.

trajdata, without maps, runs in an environment of its own, which ``tests/trajdata/make_environment.sh`` makes; UniTraj
in that of ``tests/learn/make_environment.sh``, from the checkout that ``SCENARIONET_UNITRAJ`` names.
"""

from __future__ import annotations

import gc
import json
import os
import pickle
import statistics
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenarionet_data import Lake, Samples, ScenarioLoader, Targets, TimeWindow
from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.conversion import convert
from scenarionet_data.samples.selection import SamplesWarning
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from tests.bench.measure import Figure, peak_mb
from tests.fixtures.lakes import write_shard
from tests.learn.unitraj_inputs import as_dictionary, config

_BATCH, _BATCHES = 32, 60
_LONG = 100_000
_SCENARIOS = 1_000
_HISTORY = 11
_ROOT = Path(__file__).parents[2]
_STATES = """
SELECT
    scenario_id, track_id, timestep, object_type::VARCHAR AS object_type,
    x, y, z, heading, vx, vy, length, width, height
FROM states JOIN metadata USING (scenario_id)
WHERE num_map_features > 0
ORDER BY ALL
"""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """64 agents, 11 steps of history, 80 of future, 256 polylines of 20 points, of recorded (else generated) scenes."""
    with tempfile.TemporaryDirectory() as folder:
        lake = _lake(Path(folder) / "lake", recordings)
        ids = lake.sql("SELECT scenario_id FROM metadata WHERE num_map_features > 0 ORDER BY 1")[
            "scenario_id"
        ].to_list()
        started = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SamplesWarning)
            samples = Samples(lake, ids, window=TimeWindow(stride=1.0), targets=Targets("moving"))
        yield Figure(f"samples: find {len(samples):,} samples", time.process_time() - started, "s")
        scene = samples.places
        numbers = [np.flatnonzero(scene == place) for place in np.unique(scene)]
        rng = np.random.default_rng(0)
        for cache_bytes, kind in ((0, "read anew"), (2**29, "in memory")):
            samples = Samples(
                lake, ids, window=TimeWindow(stride=1.0), targets=Targets("moving"), cache_bytes=cache_bytes
            )
            for k in range(0, len(numbers) if cache_bytes else 0, _BATCH):
                samples.batch([int(of_scene[0]) for of_scene in numbers[k : k + _BATCH]])
            for count, wanted in ((8, ">= 15000"), (1, ">= 5000")):

                def draw(targets: int = count) -> list[int]:
                    # Distinct ones: a batch reads each scenario once.
                    chosen = rng.choice(len(numbers), min(_BATCH // targets, len(numbers)), replace=False)
                    return [int(k) for place in chosen for k in rng.choice(numbers[place], targets)]

                rate = _rate(samples.batch, draw)
                what = f"samples: {count} targets of a random one of {len(numbers):,} scenarios, {kind}"
                yield Figure(what, rate, "samples/s", wanted if cache_bytes else "")
        yield _gathered(samples, numbers, Path(folder))
        yield from _trajdata(lake, Path(folder), rate)
        yield from _unitraj(lake, samples, Path(folder), rate)
        before = peak_mb()
        for _ in range(_LONG // _BATCH):
            samples.batch(rng.integers(0, len(samples), _BATCH))
        yield Figure(f"samples: growth of peak memory over {_LONG:,} samples", peak_mb() - before, "MB", "<= 20")


def _gathered(samples: Samples, numbers: list[Int64], folder: Path) -> Figure:
    """Finished samples, one of each scenario, gathered from a file that is mapped into memory."""
    rows = [b"".join(v.tobytes() for v in samples[int(of_scene[0])].values()) for of_scene in numbers]
    (folder / "finished").write_bytes(b"".join(rows))
    stored = np.memmap(folder / "finished", np.uint8, "r", shape=(len(rows), len(rows[0])))
    rng = np.random.default_rng(0)
    rate = _rate(stored.__getitem__, lambda: rng.choice(len(rows), _BATCH, replace=False).tolist())
    return Figure(f"samples: gather finished ones of {len(rows[0]):,} bytes from a mapped file", rate, "samples/s")


def _rate(make: Callable[[list[int]], object], draw: Callable[[], list[int]]) -> float:
    """Samples per second of processor time."""
    for _ in range(20):
        make(draw())
    gc.disable()
    times = []
    for _ in range(_BATCHES):
        chosen = draw()
        started = time.process_time()
        make(chosen)
        times.append((time.process_time() - started) / len(chosen))
    gc.enable()
    return 1 / statistics.median(times)


def _trajdata(lake: Lake, folder: Path, rate: float) -> Iterator[Figure]:
    """Samples of trajdata over the same scenarios, and how many times as many are made here with one target each."""
    python = _ROOT / ".venv-trajdata" / "bin" / "python"
    if not python.exists():
        warnings.warn(
            f"{python} is missing: trajdata is not measured; tests/trajdata/make_environment.sh makes it", stacklevel=2
        )
        return
    lake.sql(_STATES).write_parquet(folder / "states.parquet")
    script = _ROOT / "tests" / "trajdata" / "speed.py"
    command = [str(python), str(script), str(folder / "states.parquet"), str(folder / "trajdata")]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    (found,) = [line.removeprefix("RESULT") for line in printed.splitlines() if line.startswith("RESULT")]
    peer = json.loads(found)["rate"]
    yield Figure("samples: trajdata 1.4.0, without a map, from its cache", peer, "samples/s")
    yield Figure("samples: one target of a random scenario, times trajdata", rate / peer, "", ">= 60")


def _unitraj(lake: Lake, samples: Samples, folder: Path, rate: float) -> Iterator[Figure]:
    """Samples of UniTraj's own code over the same scenarios, one target each."""
    python, checkout = _ROOT / ".venv-learn" / "bin" / "python", os.environ.get("SCENARIONET_UNITRAJ")
    if checkout is None or not python.exists():
        missing = "SCENARIONET_UNITRAJ names no checkout of github.com/vita-epfl/UniTraj"
        missing = missing if checkout is None else f"{python} is missing, which tests/learn/make_environment.sh makes"
        warnings.warn(f"{missing}: UniTraj is not measured", stacklevel=2)
        return
    firsts = {key.scenario_id: key for key in map(samples.key, range(len(samples) - 1, -1, -1))}
    (folder / "unitraj").mkdir()
    paths = []
    for scenario in ScenarioLoader(lake, [name for name, key in firsts.items() if key.timestep == _HISTORY - 1]):
        paths.append(folder / "unitraj" / f"{len(paths)}.pkl")
        paths[-1].write_bytes(pickle.dumps(as_dictionary(scenario, firsts[scenario.id].track_ids)))
    program, chosen = _ROOT / "tests" / "learn" / "unitraj_speed.py", config(_HISTORY, 80, 64, 256, 20)
    command = [str(python), str(program), checkout, json.dumps(chosen), *map(str, paths)]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    (found,) = [line.removeprefix("RESULT") for line in printed.splitlines() if line.startswith("RESULT")]
    peer = json.loads(found)["rate"]
    yield Figure("samples: UniTraj, with a map, to its cache", peer, "samples/s")
    yield Figure("samples: one target of a random scenario, times UniTraj", rate / peer, "")


def _lake(root: Path, recordings: Path | None) -> Lake:
    """Copies of every recorded scene that has a map of its own, some 1,000 scenarios."""
    if recordings is None:
        convert("pg", "0:16", root)
        return Lake(root)
    convert("scenarionet", str(recordings / "scenarionet"), root)
    convert("waymo", str(recordings / "waymo" / "training"), root)
    convert("argoverse2", str(recordings / "argoverse2" / "motion-forecasting" / "val"), root)
    recorded, copies = [each for each in ScenarioLoader(root) if each.map is not None], root.with_name("copies")
    shards = []
    for scenario in recorded:
        count = -(-_SCENARIOS // len(recorded))
        same = [replace(scenario, id=f"{scenario.id}-{number}") for number in range(count)]
        shards.append(write_shard(copies, same, scenario.id.replace("/", "-"), scenario.id))
    commits.commit(open_files(copies), shards, "copies")
    return Lake(copies)
