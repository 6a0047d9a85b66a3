"""Cameras: frames per second of processor time on generated scenes, with meshes and textures."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import Manager, get_context
from threading import Barrier

import numpy as np

from scenarionet_data import converters
from scenarionet_data.arrays.dtypes import Int32
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.sensors.bird_view import BirdView
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.sensors.lidar_presets import HDL_32E, PANDAR_64
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.bench.measure import Figure

SEEDS = (3, 7, 12, 16)
_ROUNDS, _FRAMES = 9, 24
_METADRIVE = "MetaDrive without a GPU 1.06 at 1920 x 1080"


def figures() -> Iterator[Figure]:
    """Measure."""
    simulation = scenes()
    one, many = simulation.agents[:1], np.tile(simulation.agents, (16, 1))
    for width, height, channels, agents, target in (
        (1928, 1208, ("rgb", "depth"), one, 20),
        (640, 360, ("rgb",), one, 200),
        (84, 84, ("rgb",), one, 8000),
        (84, 84, ("rgb",), many, 8000),
    ):
        seconds = _processor_time(partial(_draw, simulation, Camera(width, height, channels=channels), agents))
        name = f"{width} x {height} {' '.join(channels)}, {len(agents)} a call"
        yield Figure(f"camera {name}", len(agents) / seconds, "frames/s", f">= {target}", _METADRIVE)
    yield from _two_cores()
    for name, lidar in (("HDL-32E", HDL_32E), ("Pandar64", PANDAR_64)):
        out = lidar.empty(1)
        seconds = _processor_time(partial(
            lidar.observe, simulation.batch, simulation.state, one, np.random.default_rng(0), out
        ))  # fmt: skip
        yield Figure(f"lidar {name}", out[..., 0].size / seconds / 1e6, "M rays/s", ">= 2")
    view, rng = BirdView(), np.random.default_rng(0)
    out = view.empty(1)
    seconds = _processor_time(lambda: view.observe(simulation.batch, simulation.state, one, rng, out))
    yield Figure(f"bird's view {'x'.join(map(str, view.shape))}", 1 / seconds, "pictures/s", ">= 1000")


def _draw(simulation: Simulation, camera: Camera, agents: Int32) -> None:
    camera.frames(simulation.batch, simulation.state, agents)


def scenes() -> Simulation:
    """Four generated worlds, 2 s after their beginning."""
    converter = converters.get("pg")
    worlds = []
    for seed in SEEDS:
        (shard,) = converter.shards(f"{seed}:{seed + 1}", "train", converter.release, converter.Options())
        worlds.append(World.from_scenario(converter.scenario(shard, seed)))
    simulation = Simulation(worlds, (Replay(),), has_passengers=True)
    for _ in range(20):
        simulation.step()
    return simulation


def _two_cores() -> Iterator[Figure]:
    """Two threads against one, and against two processes of one thread each, in turns, in wall time.

    Where a core is shared with the guests of other virtual machines, two processes are not twice as fast as one either.
    """
    gains, shares = [], []
    with Manager() as manager, ProcessPoolExecutor(2, get_context("spawn")) as processes:
        start = manager.Barrier(2)
        for _ in range(_ROUNDS + 1):
            alone, together = _rate(1), _rate(2)
            apart = sum(processes.map(_rate, (1, 1), (start, start)))
            gains.append(together / alone)
            shares.append(together / apart)
    name = "camera 1280 x 720 rgb, two threads"
    yield Figure(f"{name}, as a multiple of one", statistics.median(gains[1:]), "", ">= 1.8")
    yield Figure(f"{name}, as a share of two processes", statistics.median(shares[1:]), "", ">= 0.9")


def _rate(threads: int, start: Barrier | None = None) -> float:
    """Frames per second of wall time; with a barrier, beside another process."""
    simulation, camera = _scenes_of_process(), Camera(1280, 720, threads=threads)
    _draw(simulation, camera, simulation.agents[:1])
    if start is not None:
        start.wait()
    started = time.perf_counter()
    for _ in range(_FRAMES):
        _draw(simulation, camera, simulation.agents[:1])
    return _FRAMES / (time.perf_counter() - started)


@cache
def _scenes_of_process() -> Simulation:
    return scenes()


def _processor_time(run: Callable[[], object], repeats: int = 15) -> float:
    run()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        run()
        times.append(time.process_time() - started)
    return statistics.median(sorted(times)[: repeats // 2 + 1])
