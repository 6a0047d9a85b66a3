"""Cameras: frames per second of processor time on generated scenes, with meshes and textures."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from scenarionet_data import converters
from scenarionet_sim.policies import Replay
from scenarionet_sim.sensors import Camera
from scenarionet_sim.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.bench.measure import Figure

SEEDS = (3, 7, 12, 16)
_METADRIVE = "MetaDrive without a GPU 1.06 at 1920 x 1080"


def figures() -> Iterator[Figure]:
    """Measure."""
    simulation = _simulation()
    one, all_egos = simulation.agents[:1], simulation.agents
    for width, height, channels, agents, target in (
        (1928, 1208, ("rgb", "depth"), one, 20),
        (640, 360, ("rgb",), one, 200),
        (84, 84, ("rgb",), all_egos, 8000),
    ):
        camera = Camera(width, height, channels=channels)
        seconds = _processor_time(lambda camera=camera, agents=agents: camera.frames(  # type: ignore[misc]
            simulation.batch, simulation.state, agents
        ))  # fmt: skip
        name = f"{width} x {height} {' '.join(channels)}"
        yield Figure(f"camera {name}", len(agents) / seconds, "frames/s", f">= {target}", _METADRIVE)
    camera = Camera(1280, 720)
    times = []
    for threads in (1, 2):
        chosen = replace(camera, threads=threads)
        chosen.frames(simulation.batch, simulation.state, one)
        started = time.perf_counter()
        for _ in range(5):
            chosen.frames(simulation.batch, simulation.state, one)
        times.append(time.perf_counter() - started)
    yield Figure("camera, two threads against one, wall time", times[0] / times[1], "x", ">= 1.8")


def _simulation() -> Simulation:
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
    return statistics.median(np.sort(times)[: repeats // 2 + 1].tolist())
