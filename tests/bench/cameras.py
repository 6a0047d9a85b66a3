"""Cameras: frames per second of processor time on generated scenes, with meshes and textures."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from scenarionet_data import converters
from scenarionet_data.arrays.dtypes import Int32
from scenarionet_sim.policies import Replay
from scenarionet_sim.sensors import BirdView, Camera
from scenarionet_sim.sensors.lidar_presets import HDL_32E, PANDAR_64
from scenarionet_sim.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.bench.measure import Figure

SEEDS = (3, 7, 12, 16)
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
    draws = [partial(_draw, simulation, Camera(1280, 720, threads=threads), one) for threads in (1, 2)]
    ratios = []
    for draw in (*draws, *draws):
        draw()
    for _ in range(5):
        alone, together = (_wall_time(draw) for draw in draws)
        ratios.append(alone / together)
    yield Figure("camera, two threads against one, wall time", statistics.median(ratios), "x", ">= 1.8")
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


def _processor_time(run: Callable[[], object], repeats: int = 15) -> float:
    run()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        run()
        times.append(time.process_time() - started)
    return statistics.median(sorted(times)[: repeats // 2 + 1])


def _wall_time(run: Callable[[], object]) -> float:
    started = time.perf_counter()
    run()
    return time.perf_counter() - started
