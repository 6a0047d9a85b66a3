"""Frames of cameras drawn on a graphics card; the host uploads poses and reads how many triangles are in view."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from threading import Lock
from typing import Any, cast

import numba.cuda
import numpy as np

from scenarionet_data.arrays.dtypes import Int32
from scenarionet_sim.cameras.channels import CHANNELS, tail_of_channel
from scenarionet_sim.cameras.cuda import kernels
from scenarionet_sim.cameras.cuda.frames import DeviceFrames
from scenarionet_sim.cameras.cuda.items import (
    LANES,
    NUM_BOX,
    NUM_COUNTS,
    NUM_INSTANCE,
    NUM_INSTANCES,
    NUM_ITEM,
    NUM_TRIANGLES,
    Items,
)
from scenarionet_sim.cameras.cuda.kernels import launch
from scenarionet_sim.cameras.cuda.memory import DeviceMemory
from scenarionet_sim.cameras.draw.shadows import NUM_SHADOW
from scenarionet_sim.cameras.draw.structures import (
    BAND,
    GROUP,
    SKY_STEP,
    Ground,
    Look,
    Meshes,
    Pictures,
    SceneArrays,
    Shots,
    Solids,
)
from scenarionet_sim.cameras.drawing import Optics, Rig, pictures_for, shots_of, triangles_for
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.stage import Stage, stage_of
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

cuda: Any = numba.cuda

_EACH_CALL = "motion", "size", "object_type", "present", "timestep", "dt", "place", "fixed_range"
"""Arrays of ``Solids`` that are uploaded at every call."""

_drawing = Lock()
"""Calls share buffers."""


def draw(batch: WorldBatch, state: State, rig: Rig, optics: Optics, channels: Sequence[str]) -> dict[str, DeviceFrames]:
    """Draw the frames of B cameras on the current graphics card.

    Takes what ``cameras.drawing.draw`` takes, except for lidars.

    Returns:
        Arrays (B, H, W) or (B, H, W, values) by channel, in memory of their own.
    """
    count, size = len(rig.owners), (optics.height, optics.width)
    pictures = pictures_for(cuda.device_array, count, optics, channels)
    if count:
        with _drawing:
            memory, stage = _memory_of(cuda.current_context().device.uuid), stage_of(batch, rig.scenery)
            shots = shots_of(rig, optics, channels)
            changing = {name: memory.put(name, getattr(shots, name)) for name in ("owners", "poses", "lens")}
            shots = shots._replace(**changing, rays=memory.constant(shots.rays), rings=memory.constant(shots.rings))
            _draw(memory, shots, _scene_on(memory, batch, state, stage, rig.look), pictures)
    made: dict[str, Any] = dict(zip(CHANNELS, pictures, strict=True))
    return {name: DeviceFrames(made[name].reshape((count, *size, *tail_of_channel(name)))) for name in channels}


@lru_cache
def _memory_of(uuid: str) -> DeviceMemory:
    del uuid  # of the card, as contexts have no hash, and know their cards by weak references, which have none
    return DeviceMemory()


def _draw(memory: DeviceMemory, shots: Shots, scene: SceneArrays, pictures: Pictures) -> None:
    """Launch the kernels of all steps, see ``items``."""
    height, width, num_frames = shots.height, shots.width, len(shots.owners)
    items = _items(memory, num_frames, scene.solids)
    num_items = items.drawn.shape[1]
    launch(kernels.find, num_frames * num_items, num_items, shots, scene, items)
    launch(kernels.list_found, num_frames, scene, items)
    counts: Int32 = cast(Any, items.counts).copy_to_host()
    ends = np.cumsum(counts[:, NUM_TRIANGLES], dtype=np.int64)
    items = items._replace(first=memory.put("first", (ends - counts[:, NUM_TRIANGLES]).astype(np.int32)))
    # One more than there are: functions of lanes read the first one where a pixel sees none.
    triangles = triangles_for(memory.buffer, int(ends[-1]) + 1)
    places = int(counts[:, NUM_INSTANCES].max())
    launch(kernels.set_up, num_frames * places * LANES, places, shots, scene, items, triangles)
    launch(kernels.bound, num_frames * places, places, items, triangles)
    rows = -(-height // BAND) + 1
    nodes = memory.buffer("nodes", (num_frames, rows, 3, width // SKY_STEP + 2), np.float32)
    sky = memory.buffer("sky", (num_frames, rows, 4, width), np.float32)
    if shots.is_colored:
        launch(kernels.light, nodes.size // 3, shots, scene.look, nodes)
        launch(kernels.stretch, sky.size // 4, nodes, sky)
    launch(kernels.draw, num_frames * height * width, shots, scene, items, triangles, sky, pictures)


def _scene_on(memory: DeviceMemory, batch: WorldBatch, state: State, stage: Stage, look: Look) -> SceneArrays:
    """Return what cameras see with its arrays on the card."""
    solids, kinds, logs = stage.solids(batch, state), stage.kinds, batch.pool.kinds
    stored = memory.rows(kinds["fixed"]) | memory.rows(logs["log"]) | memory.rows(logs["lights"])
    stored |= {name: memory.put(name, getattr(solids, name)) for name in _EACH_CALL}
    ground = memory.rows(kinds["cells"]) | memory.rows(kinds["strokes"]) | memory.rows(kinds["heights"])
    ground |= {name: memory.put(f"ground_{name}", getattr(stage.ground, name)) for name in Ground._fields[:4]}
    return SceneArrays(
        Solids(**stored, light_color=memory.constant(solids.light_color)),
        Ground(**ground),
        Meshes(*(memory.constant(values) for values in library())),
        Look(memory.put("lights", look.lights), memory.constant(look.grain), memory.constant(look.tone)),
    )


def _items(memory: DeviceMemory, num_frames: int, solids: Solids) -> Items:
    """Return memory for the objects and fixtures of all frames."""
    ranges = cast(Any, solids.fixed_range).copy_to_host()
    all_items = num_frames, solids.motion.shape[1] + GROUP * int(np.diff(ranges, axis=1).max())
    return Items(
        boxes=memory.buffer("boxes", (*all_items, NUM_BOX), np.float64),
        kinds=memory.buffer("kinds", (*all_items, NUM_ITEM), np.int32),
        shadows=memory.buffer("shadows", (*all_items, NUM_SHADOW), np.float64),
        drawn=memory.buffer("drawn", all_items, np.int32),
        instances=memory.buffer("instances", (*all_items, NUM_INSTANCE), np.int32),
        counts=memory.buffer("counts", (num_frames, NUM_COUNTS), np.int32),
        first=memory.buffer("first", (num_frames,), np.int32),
    )


def scaled_down(rgb: DeviceFrames, factor: int) -> DeviceFrames:
    """Return pictures (B, H, W, 3) as the means of squares of pixels, for smooth edges."""
    count, height, width, _ = rgb.shape
    pictures = cuda.device_array((count, height // factor, width // factor, 3), np.uint8)
    launch(kernels.shrink, pictures.size // 3, rgb.array, factor, pictures)
    return DeviceFrames(pictures)


def add_pixel_noise(rgb: DeviceFrames, spread: float, rng: np.random.Generator) -> None:
    """Add Gaussian noise of a standard deviation [levels] to pictures in place."""
    launch(kernels.add_noise, rgb.array.size, spread, int(rng.integers(1 << 62)), rgb.array.reshape(rgb.array.size))
