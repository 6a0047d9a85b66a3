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
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scenarionet_data.compiled import shipped
from scenarionet_data.compiled.announcing import compilations, telling

SEEDS = "8:10"
"""Generated scenarios that the kernels run on: one without traffic lights, one with."""
_NUM_SCENARIOS, _NUM_TASKS = 2, 7


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
    first = len(compilations)
    with TemporaryDirectory(prefix="scenarionet-compile-") as folder, telling(lambda _: None):
        known, begin = first, time.process_time()
        for task in _do_a_little(str(Path(folder) / "lake")):
            cached = sum(done.from_cache for done in compilations[known:])
            compiled = len(compilations) - known - cached
            finished.append(CompiledTask(task, compiled, cached, time.process_time() - begin))
            known, begin = len(compilations), time.process_time()
            if on_progress is not None:
                on_progress(len(finished), _NUM_TASKS)
    folders = {done.cache_folder for done in compilations[first:] if done.cache_folder is not None}
    return CompileReport(tuple(finished), tuple(sorted(folders)))


def _do_a_little(lake: str) -> Iterator[str]:
    """Do everything that has kernels, for a few scenarios; yield what was done after each task."""
    import scenarionet_sim as sim
    from scenarionet_data import Samples, ScenarioLoader, Targets, TimeWindow, convert
    from scenarionet_data.storage.read.parquet import COMPILE_AFTER
    from scenarionet_sim.render.space import Film, recorded_moments

    convert("pg", SEEDS, lake)
    yield "convert"
    loader = ScenarioLoader(lake)
    for index in range(COMPILE_AFTER + 2 * len(loader)):  # the first ones are decoded by Arrow
        _ = loader[index % len(loader)]
    yield "load"
    for perspective in ("agent", "scene"):
        samples = Samples(lake, window=TimeWindow(1.0, 1.0), targets=Targets("moving"), perspective=perspective)
        samples.batch(list(range(len(samples)))[:_NUM_SCENARIOS])
    yield "samples"
    others = (
        sim.LaneLineDetector(), sim.LightAhead(), sim.PointCloud(), sim.Surrounding(), sim.RouteTraffic(),
        sim.Guidance(), sim.RoadSegments(),
    )  # fmt: skip
    for sensors in (sim.PAPER_OBSERVATION, (*sim.BOUNDARY, *others), (sim.BirdView(),)):
        env = sim.ScenarioNetEnv(scenarios=sim.Scenarios(lake), sensors=sensors, observation="dict", prefetch=0)
        _drive(env, lambda: [0.0, 0.5])
    yield "simulate"
    for traffic in (sim.Idm(), sim.ConstantVelocity(), sim.RouteFollower()):
        policies = sim.Replay(), traffic, sim.External()
        vector = sim.ScenarioNetVectorEnv(num_envs=_NUM_SCENARIOS, scenarios=sim.Scenarios(lake), policies=policies)
        _drive(vector, vector.action_space.sample)
    yield "simulate traffic"
    many = sim.ScenarioNetParallelEnv(scenarios=sim.Scenarios(lake))
    _drive(many, lambda: {agent: many.action_space(agent).sample() for agent in many.agents})
    yield "simulate many agents"
    for channels in (("rgb",), ("rgb", "depth", "semantic", "instance", "normals", "flow")):
        cameras = sim.Camera(width=16, height=16, channels=channels), sim.EgoState()
        env = sim.ScenarioNetEnv(scenarios=sim.Scenarios(lake), sensors=cameras, observation="dict", prefetch=0)
        _drive(env, lambda: [0.0, 0.5])
    world = sim.World.from_scenario(loader[0])
    next(Film("chase", 32, 18).frames(world, recorded_moments(world)[:2]))
    yield "cameras"


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
    compile_kernels()
    packages = {done.name.rsplit(".", 2)[0]: done.cache_folder for done in compilations if done.cache_folder}
    for package, folder in packages.items():
        shutil.copytree(folder, Path(sys.argv[1]) / package)


if __name__ == "__main__":
    runnable = shipped.levels_of_host()
    ship_kernels(runnable if sys.argv[1:] == ["all"] else runnable[:1])
