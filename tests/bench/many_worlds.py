"""Steps of many worlds: the Python around the compiled step, and the memory of worlds."""

from __future__ import annotations

import gc
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from scenarionet_data import ScenarioLoader
from scenarionet_data.compiled.dispatchers import Kernel
from scenarionet_data.conversion import convert
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, MultiAgentConfig, VectorConfig
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.scenarios.selection import Scenarios
from tests.bench.measure import Figure, in_fresh_process

_WORLDS = (1, 64, 256, 1024)
_STEPS = 200
_COUNTED = 20
"""Steps whose instructions are counted."""
_DISPLACING = 1024
"""Worlds whose data displace Python from the caches: its time is that of the memory, its instructions the same."""
_COPIES = 5
_MEMORY = """
import json, os, sys
from pathlib import Path
import numpy as np
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.scenarios.selection import Scenarios
envs = ScenarioNetVectorEnv(
    256, scenarios=Scenarios(sys.argv[1], json.loads(sys.argv[2])), sensors=PAPER_OBSERVATION + BOUNDARY, cache_size=64,
    prefetch=0,
)
envs.reset(seed=0)
for _ in range(300):
    envs.step(np.zeros((256, 2)))
print(int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
"""


def figures(lake: Path, recordings: Path | None) -> Iterator[Figure]:
    """Processor time of a step outside of compiled functions, and the memory of 256 slots over 64 worlds."""
    for count in _WORLDS:
        for name, envs in _environments(lake, count).items():
            step = f"sim: {count} worlds, {name}, Python of a step"
            yield Figure(step, _python_of_step(envs), "us", "<= 150" if count < _DISPLACING else "")
            yield Figure(step, _instructions_of_step(envs), "instructions", "<= 1200")
            envs.close()
    if recordings:
        copies = lake.parent / "copies"
        for number in range(_COPIES):
            convert("scenarionet", str(recordings / "scenarionet"), copies, version=f"copy{number}")
        ids = list(ScenarioLoader(copies).scenario_ids[:64])
        used = json.loads(in_fresh_process(_MEMORY, str(copies), json.dumps(ids)))
        yield Figure("sim: 256 slots over 64 recorded worlds, the whole process", used, "MB", "<= 450")


def _environments(lake: Path, count: int) -> dict[str, Any]:
    """Environments of some worlds on one core, by name."""
    scenarios, sensors = Scenarios(lake, order="random"), PAPER_OBSERVATION + BOUNDARY
    config = VectorConfig(scenarios, sensors=sensors)
    return {
        "vector environment": ScenarioNetVectorEnv(count, scenarios=scenarios, sensors=sensors, threads=1),
        "flat buffers": FlatEnv(count, config, seed=0, threads=1),
        "flat buffers of all vehicles": FlatEnv(count, MultiAgentConfig(scenarios), seats=40, seed=0, threads=1),
    }


def _python_of_step(envs: Any) -> float:
    """Median of the microseconds of a step outside of kernels, episodes that begin included."""
    envs.reset(seed=0)
    actions = np.zeros((getattr(envs, "num_agents", None) or envs.num_envs, 2))
    for _ in range(60):  # until episodes end at different times
        envs.step(actions)
    found = []
    with _timed_kernels() as spent:
        for _ in range(_STEPS):
            spent[0] = 0
            started = time.perf_counter_ns()
            envs.step(actions)
            found.append((time.perf_counter_ns() - started - spent[0]) / 1e3)
    return statistics.median(found)


def _instructions_of_step(envs: Any) -> float:
    """Median of the interpreter's instructions in a step, which no other program disturbs."""
    actions, counts = np.zeros((getattr(envs, "num_agents", None) or envs.num_envs, 2)), []

    def count(frame: FrameType, event: str, _: object) -> Any:
        frame.f_trace_opcodes = True
        counts[-1] += event == "opcode"
        return count

    for _ in range(_COUNTED):
        counts.append(0)
        sys.settrace(count)
        envs.step(actions)
        sys.settrace(None)
    return statistics.median(counts)


@contextmanager
def _timed_kernels() -> Iterator[list[int]]:
    """Measure the time in kernels that were called before: nanoseconds in a list of one number."""
    spent = [0]
    kernels = [each for each in gc.get_objects() if isinstance(each, Kernel) and hasattr(each, "only_entry")]
    entries = {kernel: kernel.only_entry for kernel in kernels}
    for kernel, entry in entries.items():
        kernel.only_entry = _timed(entry, spent)
    try:
        yield spent
    finally:
        for kernel, entry in entries.items():
            kernel.only_entry = entry


def _timed(function: Callable[..., Any], spent: list[int]) -> Callable[..., Any]:
    def call(*arguments: Any) -> Any:
        started = time.perf_counter_ns()
        try:
            return function(*arguments)
        finally:
            spent[0] += time.perf_counter_ns() - started

    return call
