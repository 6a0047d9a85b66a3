"""Cameras on a graphics card: frames per second of wall time that stay on the card, with meshes and textures."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Int32
from scenarionet_sim.cameras.cuda.availability import require_cuda
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.simulation.simulation import Simulation
from tests.bench.cameras import scenes
from tests.bench.measure import Figure

SIZES = ((1920, 1080, 1, 300), (1920, 1080, 16, 300), (128, 128, 1024, 100_000))
"""Width, height, frames of a call, and frames per second to reach."""


def figures(sizes: tuple[tuple[int, int, int, int], ...] = SIZES) -> Iterator[Figure]:
    """Measure; the card is in the names."""
    require_cuda()
    import numba.cuda

    cuda: Any = numba.cuda
    card, simulation = _name_of(cuda.get_current_device()), scenes()
    for width, height, count, target in sizes:
        agents = np.tile(simulation.agents, (-(-count // len(simulation.agents)), 1))[:count]
        camera = Camera(width, height, channels=("rgb", "depth"), device="cuda")
        seconds = _wall_time(simulation, camera, agents, cuda)
        name = f"camera on {card}, {width} x {height} rgb depth, {count} a call"
        yield Figure(name, count / seconds, "frames/s", f">= {target}")


def _name_of(device: Any) -> str:
    name = getattr(device, "name", "a simulated card")
    return name.decode() if isinstance(name, bytes) else str(name)


def _wall_time(simulation: Simulation, camera: Camera, agents: Int32, cuda: Any, repeats: int = 20) -> float:
    """Return the seconds of a call until its frames are drawn; the first call compiles and uploads."""
    times = []
    for _ in range(repeats + 1):
        started = time.perf_counter()
        camera.frames_on_card(simulation.batch, simulation.state, agents)
        cuda.synchronize()
        times.append(time.perf_counter() - started)
    return statistics.median(times[1:])
