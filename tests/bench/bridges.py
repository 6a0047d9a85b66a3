"""Stacks over their wires: how long an answer takes, and how many pictures and scans they get a second."""

from __future__ import annotations

import resource
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.bridges import stacks
from scenarionet_sim.bridges.driver import wire
from scenarionet_sim.bridges.link import Link
from scenarionet_sim.drivers.by_name import resolve_drivers
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.rollouts.batch import RolloutBatch, RolloutJob
from scenarionet_sim.worlds.world import World
from tests.bench.measure import Figure
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.ros.test_ros2 import stack


class _Timed(Link):
    """Keeps how long each answer took [s]."""

    def __init__(self, link: Link) -> None:
        super().__init__(link.transport, link.limit)
        self.taken: list[float] = []

    def _answer(self, moment: Any) -> Any:
        started = time.perf_counter()
        try:
            return super()._answer(moment)
        finally:
            self.taken.append(time.perf_counter() - started)


def worlds_in_lockstep(count: int = 64, steps: int = 100) -> Iterator[Figure]:
    """Measure: a driver in a process of its own, the example in Python, drives many worlds with ten other vehicles."""
    others = tuple(Other(20.0 + 7.0 * number, 3.5, vx=6.0) for number in range(10))
    worlds = [World.from_scenario(make_drive(f"d{k}", num_steps=steps + 1, others=others)) for k in range(count)]
    jobs = [RolloutJob(number, world) for number, world in enumerate(worlds)]
    with socket.create_server(("127.0.0.1", 0)) as server:
        policy = f"driver:{server.getsockname()[1]}"
    descriptors = Path(wire.__file__).parent / "driver.binpb"
    words = [sys.executable, "docs/examples/driver_process.py", policy.partition(":")[2], str(descriptors)]
    before, process = _of_children(), subprocess.Popen(words)
    everything = 0.0
    try:
        batch = RolloutBatch(resolve_drivers(policy), Kinematic(), count)
        for is_warm in (False, True):
            started, own = time.perf_counter(), time.process_time()
            failed = [rollout for _, rollout in batch.run(jobs) if isinstance(rollout, Exception)]
            seconds, own = time.perf_counter() - started, time.process_time() - own
            everything += own
            if failed:
                raise failed[0]
            if is_warm:
                yield Figure(f"{count} worlds in lockstep, driver", count * steps / seconds, "steps/s", ">= 2000")
                yield Figure(f"{count} worlds, processor time of this process", count * steps / own, "steps/s")
    finally:
        process.kill()
        process.wait()
    everything += _of_children() - before  # both runs, and the driver's start
    yield Figure(f"{count} worlds, processor time of both processes", 2 * count * steps / everything, "steps/s")


def _of_children() -> float:
    """Processor time of processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def figures() -> Iterator[Figure]:
    """Measure: messages made, sent, answered and read, with a driver of another process."""
    yield from worlds_in_lockstep()
    with tempfile.TemporaryDirectory() as folder:
        scenarios = [make_drive(f"d{number}", speed=8.0 + number / 10) for number in range(12)]
        write_lake(Path(folder) / "lake", scenarios)
        for policy in ("ros2:dds", "ros2:zenoh", "ros2:zenoh+camera+lidar"):
            wire = policy.removeprefix("ros2:").partition("+")[0]
            timed = _Timed(stacks.link(stacks.Stack.parse(policy)))
            before = stacks.link
            stacks.link = lambda _, timed=timed: timed  # type: ignore[assignment]
            with stack(wire, "sensors" if "camera" in policy else ""):
                evaluate(Path(folder) / "lake", policy=policy, name=f"warm-{wire}-{len(policy)}")
                timed.taken.clear()
                started, own = time.perf_counter(), time.process_time()
                evaluate(Path(folder) / "lake", policy=policy, name=f"{wire}-{len(policy)}")
                seconds, own = time.perf_counter() - started, time.process_time() - own
            stacks.link = before
            timed.transport.close()
            stacks.link.cache_clear()
            if "camera" in policy:
                yield Figure(f"640 x 360 pictures and scans, {policy}", len(timed.taken) / seconds, "Hz", ">= 20")
                yield Figure(f"processor time of a timestep with both, {policy}", 1e3 * own / len(timed.taken), "ms")
            else:
                median, last = 1e3 * statistics.median(timed.taken), 1e3 * float(np.quantile(timed.taken, 0.99))
                yield Figure(f"answer, {policy}, median", median, "ms", "<= 1")
                yield Figure(f"answer, {policy}, p99", last, "ms", "<= 5")
