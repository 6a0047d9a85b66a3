"""A Dask cluster against plain processes, memory over a long run, and the scheduler's limit on shards.

Everything runs on this machine. Workers are warm when the clock starts: each has converted a shard, so that what is
compared is converting and not importing.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarionet_data.conversion import ShardJob, ShardResult, convert, plan_conversion
from scenarionet_data.conversion.jobs import lost_shard
from scenarionet_data.conversion.plan import largest_first
from scenarionet_data.execution.executors import Executor, ProcessExecutor
from scenarionet_pipelines.cluster import open_cluster
from tests.bench.measure import Figure
from tests.fixtures import waymo
from tests.fixtures.made import NAME, write_raw

_WORKERS = 2
_SHARDS = 28
_SCENARIOS = 12
_WARM = 4
"""Shards until both workers of either kind have imported, compiled and opened everything."""

_LONG = (40, 50)
_TINY = 20_000

_ALONE = """
import sys, time
from pathlib import Path
from scenarionet_data.conversion import convert
warm, raw, lake, go = map(Path, sys.argv[1:])
convert("waymo", str(warm), lake.with_name(lake.name + "-warm"))
print("ready", flush=True)
while not go.exists():
    time.sleep(0.001)
started = time.perf_counter()
assert convert("waymo", str(raw), lake).is_clean
print(time.perf_counter() - started)
"""


def figures(_: Path | None) -> Iterator[Figure]:
    """Benchmarks of converting on a cluster, on written recordings of any number."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        raw = _waymo(root / "raw/training", _SHARDS + _WARM, _SCENARIOS)
        with open_cluster("local", _WORKERS) as executor:
            yield from _many(root, executor)
            yield from _memory(root, executor)
            yield from _speed(root, raw, executor)


def _waymo(folder: Path, shards: int, scenarios: int) -> Path:
    """Written tfrecords with scenarios as large as recorded ones."""
    folder.mkdir(parents=True)
    one = waymo.scenario_bytes(0, num_rows=32, num_vehicles=76, num_others=10, scenario_id="0" * 16)
    for shard in range(shards):
        numbers = range(shard * scenarios, (shard + 1) * scenarios)
        payloads = [one.replace(b"0" * 16, f"{number:016x}".encode()) for number in numbers]
        waymo.write_tfrecord(folder / f"training.tfrecord-{shard:05d}-of-{shards:05d}", payloads)
    return folder


# --- speed --------------------------------------------------------------------------------------------


def _speed(root: Path, raw: Path, executor: Executor) -> Iterator[Figure]:
    """The three executors in alternation, so that other load on the machine affects all of them equally."""
    alone, pool, dask = [], [], []
    for turn in range(3):
        alone.append(_independent(root, raw, turn))
        pool.append(_steady(root / f"pool-{turn}", raw, ProcessExecutor(_WORKERS)))
        dask.append(_steady(root / f"dask-{turn}", raw, executor))
    two = statistics.median(alone)
    (three, three_cpu), (four, four_cpu) = (map(statistics.median, zip(*runs, strict=True)) for runs in (pool, dask))
    name = f"{_SHARDS * _SCENARIOS} Waymo scenarios"
    yield Figure(f"{name}: two independent processes", two, "scenarios/s")
    yield Figure(f"{name}: a pool of two", three, "scenarios/s")
    yield Figure(f"{name}: two Dask workers", four, "scenarios/s")
    yield Figure("two Dask workers over two independent processes", four / two, "", ">= 0.9")
    yield Figure("time on Dask over time in a pool", three / four, "", "<= 1.1")
    yield Figure("CPU time on Dask over CPU time in a pool", four_cpu / three_cpu, "", "<= 1.1")


@dataclass(frozen=True)
class _Clocked:
    """Run a job; return its result with the CPU time used so far."""

    do: Callable[[Any], Any]

    def __call__(self, job: Any) -> tuple[int, float, Any]:
        return os.getpid(), time.process_time(), self.do(job)


def _steady(lake: Path, raw: Path, executor: Executor) -> tuple[float, float]:
    """Scenarios per second from the first few shards to the last; CPU seconds per scenario, including the client's."""
    clock: list[float] = []
    cpu: dict[int, list[float]] = defaultdict(list)

    def clocked(jobs: Iterable[Any], do: Callable[[Any], Any], lost: Any = None) -> Iterator[Any]:
        for pid, used, value in executor(jobs, _Clocked(do), lost):
            clock.append(time.perf_counter())
            cpu[pid].append(used)
            cpu[os.getpid()].append(time.process_time())
            yield value

    convert("waymo", str(raw), lake, executor=clocked)
    shards = len(clock)
    # Of each process, per shard that came after its second: the first one pays for imports and compilation.
    spent = sum((times[-1] - times[2]) / max(1, len(times) - 3) for pid, times in cpu.items() if pid != os.getpid())
    client = (cpu[os.getpid()][-1] - cpu[os.getpid()][_WARM]) / (shards - 1 - _WARM)
    rate = (shards - 1 - _WARM) * _SCENARIOS / (clock[-1] - clock[_WARM])
    return rate, (spent / (len(cpu) - 1) + client) / _SCENARIOS


def _independent(root: Path, raw: Path, turn: int) -> float:
    """Scenarios per second of independent processes, each with its part of the files."""
    files = sorted(raw.iterdir())
    warm, go = _linked(root / f"alone-{turn}/warm/training", files[:1]), root / f"alone-{turn}/go"
    running = []
    for number in range(_WORKERS):
        part = _linked(root / f"alone-{turn}/{number}/training", files[_WARM + number :: _WORKERS])
        words = [sys.executable, "-c", _ALONE, str(warm), str(part), str(part.parent / "lake"), str(go)]
        running.append(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
    for process in running:
        assert process.stdout and process.stdout.readline() == "ready\n"
    go.touch()
    seconds = max(float(process.communicate()[0]) for process in running)
    return _SHARDS * _SCENARIOS / seconds


def _linked(folder: Path, files: Iterable[Path]) -> Path:
    folder.mkdir(parents=True)
    for file in files:
        os.link(file, folder / file.name)
    return folder


# --- memory -------------------------------------------------------------------------------------------


def _memory(root: Path, executor: Executor) -> Iterator[Figure]:
    """Peak memory of each worker after a fifth of a long run, and at its end."""
    shards, scenarios = _LONG
    raw = _waymo(root / "long/training", shards, scenarios)
    peaks: list[dict[str, int]] = [{}]

    def watched(jobs: Iterable[Any], do: Callable[[Any], Any], lost: Any = None) -> Iterator[Any]:
        for result in executor(jobs, do, lost):
            peaks.append(peaks[-1] | {result.worker: result.peak_memory})
            yield result

    report = convert("waymo", str(raw), root / "long/lake", executor=watched)
    early, late = peaks[shards // 5], peaks[-1]
    growth = max(late[worker] - early.get(worker, 0) for worker in late)
    yield Figure(
        f"peak memory of a worker over {report.converted} scenarios", max(late.values()) / 2**20, "MB", "<= 2048"
    )
    yield Figure("of that, what came after the first fifth", growth / 2**20, "MB", "<= 64")


# --- many shards --------------------------------------------------------------------------------------


def _nothing(job: ShardJob) -> ShardResult:
    return lost_shard(job, "converted by nobody")


def _many(root: Path, executor: Executor) -> Iterator[Figure]:
    """Shards without work: the remaining time is planning, scheduling and tracking."""
    raw = write_raw(root / "tiny", {f"s{k:05d}": [k] for k in range(_TINY)})
    started = time.perf_counter()
    plan = plan_conversion(NAME, str(raw), root / "tiny-lake")
    jobs = [ShardJob(NAME, shard, str(root / "tiny-lake")) for shard in largest_first(plan.shards)]
    planned = time.perf_counter() - started
    names = {outcome.shard for outcome in executor(jobs, _nothing, lost_shard)}
    assert len(names) == _TINY
    yield Figure(f"{_TINY:,} shards: planned", planned, "s")
    yield Figure(f"{_TINY:,} shards: planned and tracked", time.perf_counter() - started, "s", "<= 60")
