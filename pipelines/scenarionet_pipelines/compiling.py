"""Compile the kernels of loading, samples, conversion, simulation and cameras beforehand, by doing a little of each.

As a program it compiles them for the levels of processors whose machine code travels with an installation, see
``scenarionet_data.compiled.shipped``: ``python -m scenarionet_pipelines.compiling``.
"""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scenarionet_data.compiled import shipped
from scenarionet_data.compiled.announcing import compilations, telling
from scenarionet_data.execution.executors import ProcessExecutor

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
    finished: list[CompiledTask] = []
    folders: set[str] = set()
    tell = on_progress or (lambda _done, _total: None)
    tell(0, sum(map(len, _TASKS)))
    with TemporaryDirectory(prefix="scenarionet-compile-") as folder:
        for tasks in _TASKS:
            for done, used in ProcessExecutor(1)([(task, f"{folder}/lake") for task in tasks], _do):
                finished.append(done)
                folders |= used
                tell(len(finished), sum(map(len, _TASKS)))
    return CompileReport(tuple(finished), tuple(sorted(folders)))


def _do(job: tuple[Callable[[str], None], str]) -> tuple[CompiledTask, set[str]]:
    """Do a task in a lake; return what it compiled, and the folders of the cache that it used."""
    task, lake = job
    known, begin = len(compilations), time.process_time()
    with telling(lambda _: None):
        task(lake)
    done = compilations[known:]
    cached = sum(each.from_cache for each in done)
    name = task.__name__.strip("_").replace("_", " ")
    report = CompiledTask(name, len(done) - cached, cached, time.process_time() - begin)
    return report, {each.cache_folder for each in done if each.cache_folder is not None}


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
    import scenarionet_sim as sim

    others = (
        sim.LaneLineDetector(), sim.LightAhead(), sim.PointCloud(), sim.Surrounding(), sim.RouteTraffic(),
        sim.Guidance(), sim.RoadSegments(),
    )  # fmt: skip
    for sensors in (sim.PAPER_OBSERVATION, (*sim.BOUNDARY, *others), (sim.BirdView(),)):
        env = sim.ScenarioNetEnv(scenarios=sim.Scenarios(lake), sensors=sensors, observation="dict", prefetch=0)
        _drive(env, lambda: [0.0, 0.5])


def _simulate_traffic(lake: str) -> None:
    import scenarionet_sim as sim

    for traffic in (sim.Idm(), sim.ConstantVelocity(), sim.RouteFollower()):
        policies = sim.Replay(), traffic, sim.External()
        vector = sim.ScenarioNetVectorEnv(num_envs=_NUM_SCENARIOS, scenarios=sim.Scenarios(lake), policies=policies)
        _drive(vector, vector.action_space.sample)


def _simulate_many_agents(lake: str) -> None:
    import scenarionet_sim as sim

    many = sim.ScenarioNetParallelEnv(scenarios=sim.Scenarios(lake))
    _drive(many, lambda: {agent: many.action_space(agent).sample() for agent in many.agents})


def _cameras(lake: str) -> None:
    import scenarionet_sim as sim
    from scenarionet_data import ScenarioLoader
    from scenarionet_sim.render.space import Film, recorded_moments

    for channels in (("rgb",), ("rgb", "depth", "semantic", "instance", "normals", "flow")):
        cameras = sim.Camera(width=16, height=16, channels=channels), sim.EgoState()
        env = sim.ScenarioNetEnv(scenarios=sim.Scenarios(lake), sensors=cameras, observation="dict", prefetch=0)
        _drive(env, lambda: [0.0, 0.5])
    world = sim.World.from_scenario(ScenarioLoader(lake)[0])
    next(Film("chase", 32, 18).frames(world, recorded_moments(world)[:2]))


_TASKS = (_convert, _load, _samples), (_simulate, _simulate_traffic, _simulate_many_agents), (_cameras,)
"""A little of everything that has kernels; those of one process, as a compiler's memory is freed by its end alone."""


def _drive(env: Any, act: Callable[[], Any]) -> None:
    """Reset and step an environment a few times."""
    for _ in range(_NUM_SCENARIOS):
        env.reset()
        env.step(act())
    env.close()


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
    with TemporaryDirectory(prefix="scenarionet-compile-") as lake:
        for task in itertools.chain(*_TASKS):
            _do((task, f"{lake}/lake"))
    packages = {done.name.rsplit(".", 2)[0]: done.cache_folder for done in compilations if done.cache_folder}
    for package, folder in packages.items():
        shutil.copytree(folder, Path(sys.argv[1]) / package)


if __name__ == "__main__":
    runnable = shipped.levels_of_host()
    ship_kernels(runnable if sys.argv[1:] == ["all"] else runnable[:1])
