"""Compile the kernels of loading, conversion and simulation beforehand, by doing a little of each."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from scenarionet_data.compiled.announcing import compilations, silent

SEEDS = "8:10"
"""Generated scenarios that the kernels run on: one without traffic lights, one with."""
_NUM_SCENARIOS = 2


@dataclass(frozen=True)
class CompiledTask:
    """One task whose kernels are ready.

    Attributes:
        task: For example ``"simulate"``.
        compiled: Kernels that were compiled.
        cached: Kernels that were in the cache already.
        seconds: Processor time [s], the task itself included.
    """

    task: str
    compiled: int
    cached: int
    seconds: float


@dataclass(frozen=True)
class CompileReport:
    """Result of :func:`compile_kernels`.

    Attributes:
        tasks: In the order in which they ran.
        folders: Cache folders, sorted; empty when no folder can be written to.
    """

    tasks: tuple[CompiledTask, ...]
    folders: tuple[str, ...]


def compile_kernels(on_progress: Callable[[int, int], None] | None = None) -> CompileReport:
    """Compile the kernels that loading, conversion and simulation use, and cache them on disk.

    Converters of recorded datasets compile a few kernels of their own when they first read a recording.

    Args:
        on_progress: Called with the number of finished tasks and of all.
    """
    tasks: dict[str, Callable[[str], None]] = {
        "convert": _convert,
        "load": _load,
        "simulate": _simulate,
        "simulate traffic": _simulate_traffic,
        "simulate many agents": _simulate_many_agents,
    }
    finished: list[CompiledTask] = []
    first = len(compilations)
    with TemporaryDirectory(prefix="scenarionet-compile-") as folder, silent():
        lake = str(Path(folder) / "lake")
        for task, run in tasks.items():
            if on_progress is not None:
                on_progress(len(finished), len(tasks))
            known, begin = len(compilations), time.process_time()
            run(lake)
            cached = sum(done.from_cache for done in compilations[known:])
            compiled = len(compilations) - known - cached
            finished.append(CompiledTask(task, compiled, cached, time.process_time() - begin))
    if on_progress is not None:
        on_progress(len(tasks), len(tasks))
    folders = {done.cache_folder for done in compilations[first:] if done.cache_folder is not None}
    return CompileReport(tuple(finished), tuple(sorted(folders)))


def _convert(lake: str) -> None:
    from scenarionet_data import convert

    convert("pg", SEEDS, lake)


def _load(lake: str) -> None:
    from scenarionet_data import ScenarioLoader
    from scenarionet_data.storage.read.parquet import COMPILE_AFTER

    loader = ScenarioLoader(lake)
    for index in range(COMPILE_AFTER + 2 * len(loader)):  # the first ones are decoded by Arrow
        _ = loader[index % len(loader)]


def _simulate(lake: str) -> None:
    from scenarionet_sim import (
        BOUNDARY,
        PAPER_OBSERVATION,
        BirdView,
        LaneLineDetector,
        LightAhead,
        PointCloud,
        ScenarioNetEnv,
        Scenarios,
        Surrounding,
    )

    for sensors in (
        PAPER_OBSERVATION,
        (*BOUNDARY, LaneLineDetector(), LightAhead(), PointCloud(), Surrounding()),
        (BirdView(),),
    ):
        env = ScenarioNetEnv(scenarios=Scenarios(lake), sensors=sensors, observation="dict", prefetch=0)
        for _ in range(_NUM_SCENARIOS):
            env.reset()
            env.step([0.0, 0.5])
        env.close()


def _simulate_traffic(lake: str) -> None:
    from scenarionet_sim import ConstantVelocity, External, Idm, Replay, RouteFollower, ScenarioNetVectorEnv, Scenarios

    for traffic in (Idm(), ConstantVelocity(), RouteFollower()):
        env = ScenarioNetVectorEnv(
            num_envs=_NUM_SCENARIOS, scenarios=Scenarios(lake), policies=(Replay(), traffic, External())
        )
        env.reset(seed=0)
        env.step(env.action_space.sample())
        env.close()


def _simulate_many_agents(lake: str) -> None:
    from scenarionet_sim import ScenarioNetParallelEnv, Scenarios

    env = ScenarioNetParallelEnv(scenarios=Scenarios(lake))
    for _ in range(_NUM_SCENARIOS):
        env.reset()
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    env.close()
