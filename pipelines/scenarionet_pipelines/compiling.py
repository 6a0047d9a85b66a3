"""Compile the kernels of loading, samples, conversion, simulation and cameras beforehand, by doing a little of each.

As a program it compiles them for the levels of processors whose machine code travels with an installation, see
``scenarionet_data.compiled.shipped``: ``python -m scenarionet_pipelines.compiling``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from scenarionet_data.compiled import shipped
from scenarionet_data.compiled.announcing import compilations, telling

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
    """Compile the kernels that loading, samples, conversion, simulation and cameras use, and cache them on disk.

    Converters of recorded datasets compile a few kernels of their own when they first read a recording.

    Args:
        on_progress: Called with the number of finished tasks and of all.
    """
    tasks: dict[str, Callable[[str], None]] = {
        "convert": _convert,
        "load": _load,
        "samples": _samples,
        "simulate": _simulate,
        "simulate traffic": _simulate_traffic,
        "simulate many agents": _simulate_many_agents,
        "cameras": _cameras,
    }
    finished: list[CompiledTask] = []
    first = len(compilations)
    with TemporaryDirectory(prefix="scenarionet-compile-") as folder, telling(lambda _: None):
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


def _samples(lake: str) -> None:
    from scenarionet_data import Samples, Targets, TimeWindow

    for perspective in ("agent", "scene"):
        samples = Samples(lake, window=TimeWindow(1.0, 1.0), targets=Targets("moving"), perspective=perspective)
        samples.batch(list(range(len(samples)))[:_NUM_SCENARIOS])


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


def _cameras(lake: str) -> None:
    from scenarionet_data import ScenarioLoader
    from scenarionet_sim import Camera, EgoState, ScenarioNetEnv, Scenarios
    from scenarionet_sim.render.space import Film, recorded_moments
    from scenarionet_sim.worlds.world import World

    for channels in (("rgb",), ("rgb", "depth", "semantic", "instance", "normals", "flow")):
        sensors = (Camera(width=16, height=16, channels=channels), EgoState())
        env = ScenarioNetEnv(scenarios=Scenarios(lake), sensors=sensors, observation="dict", prefetch=0)
        for _ in range(_NUM_SCENARIOS):
            env.reset()
            env.step([0.0, 0.5])
        env.close()
    world = World.from_scenario(ScenarioLoader(lake)[0])
    next(Film("chase", 32, 18).frames(world, recorded_moments(world)[:2]))


def ship_kernels(levels: list[shipped.Level]) -> None:
    """Compile for levels of processors, into the package, in place of what is there.

    Other processors and other versions of Python compile on first use.
    """
    shutil.rmtree(shipped.FOLDER, ignore_errors=True)
    for level in levels:
        with TemporaryDirectory(prefix="scenarionet-ship-") as cache:
            target = {"NUMBA_CPU_NAME": level.cpu, "NUMBA_CPU_FEATURES": level.features, "NUMBA_CACHE_DIR": cache}
            copy = "from scenarionet_pipelines import compiling; compiling._copy_compiled()"
            words = [sys.executable, "-c", copy, str(level.folder)]
            subprocess.run(words, env=os.environ | target, check=True)  # noqa: S603 - our own program


def _copy_compiled() -> None:
    """Compile in an empty cache, and copy its folders, one for each Python package, by the names of these."""
    compile_kernels()
    packages = {done.name.rsplit(".", 2)[0]: done.cache_folder for done in compilations if done.cache_folder}
    for package, folder in packages.items():
        shutil.copytree(folder, Path(sys.argv[1]) / package)


if __name__ == "__main__":
    runnable = shipped.levels_of_host()
    ship_kernels(runnable if sys.argv[1:] == ["all"] else runnable[:1])
