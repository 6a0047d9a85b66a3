"""Frames of cameras drawn on a graphics card; the host uploads poses and reads how many triangles are in view."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from threading import Lock
from typing import Any, cast

import numba.cuda
import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.cameras.cuda import kernels
from scenarionet_sim.cameras.cuda.frames import DeviceFrames
from scenarionet_sim.cameras.cuda.kernels import LANES, launch
from scenarionet_sim.cameras.cuda.memory import DeviceMemory
from scenarionet_sim.cameras.draw.layout import (
    BAND,
    GROUP,
    NUM_LIGHTS,
    NUM_VERTEX,
    SKY_STEP,
    Ground,
    Look,
    Meshes,
    Pictures,
    Solids,
)
from scenarionet_sim.cameras.draw.thread_layout import (
    NUM_BOX,
    NUM_COUNTS,
    NUM_INSTANCE,
    NUM_INSTANCES,
    NUM_ITEM,
    NUM_TRIANGLES,
    NUM_VERTICES,
    Items,
    Shots,
    Triangles,
)
from scenarionet_sim.cameras.drawing import CHANNELS, TAILS, Optics, shape_of_channel
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.stage import Scenery, Stage, stage_of
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

cuda: Any = numba.cuda

_EACH_CALL = "motion", "size", "object_type", "present", "timestep", "place", "fixed_range"
"""Arrays of ``Solids`` that are uploaded at every call."""

_drawing = Lock()
"""Calls share buffers."""


def draw(
    batch: WorldBatch,
    state: State,
    cameras: Int32,
    poses: Float64,
    optics: Optics,
    look: Look,
    scenery: Scenery,
    channels: Sequence[str],
) -> dict[str, DeviceFrames]:
    """Draw the frames of B cameras on the current graphics card.

    Takes what ``cameras.drawing.draw`` takes, except for lidars.

    Returns:
        Arrays (B, H, W) or (B, H, W, values) by channel, in memory of their own.
    """
    count, size = len(cameras), (optics.height, optics.width)
    made: dict[str, Any] = {}
    for name, (_, dtype) in CHANNELS.items():
        shape = shape_of_channel(name, size[0] * size[1])
        made[name] = cuda.device_array((count if name in channels else 0, *shape), dtype)
    if count:
        with _drawing:
            memory = _memory_of(cuda.current_context())
            _draw(memory, batch, state, cameras, poses, optics, look, stage_of(batch, scenery), Pictures(**made))
    return {name: DeviceFrames(made[name].reshape((count, *size, *TAILS[name]))) for name in channels}


@lru_cache
def _memory_of(context: Any) -> DeviceMemory:
    del context
    return DeviceMemory()


def _draw(
    memory: DeviceMemory, batch: WorldBatch, state: State, cameras: Int32, poses: Float64, optics: Optics, look: Look,
    stage: Stage, pictures: Pictures,
) -> None:  # fmt: skip
    """Launch the kernels of all steps, see ``cameras.draw.thread_items``."""
    size, num_frames = (optics.height, optics.width), len(cameras)
    is_colored = len(pictures.rgb) > 0
    options = optics.are_boxes, is_colored, optics.reach, optics.flow_time
    host_solids = stage.solids(batch, state)
    num_items = state.motion.shape[1] + GROUP * int(np.diff(host_solids.fixed_range, axis=1).max())
    ground, solids = _ground_on(memory, stage), _solids_on(memory, batch, stage, host_solids)
    meshes = Meshes(*(memory.constant(values) for values in library()))
    look = Look(memory.put("lights", look.lights), memory.constant(look.grain), memory.constant(look.tone))
    shots = _shots_on(memory, cameras, poses, optics)
    items = _items(memory, num_frames, num_items)
    all_items = num_frames * num_items
    launch(kernels.find, all_items, num_items, size, options, shots, solids, ground, meshes, look, items)
    launch(kernels.list_found, num_frames, meshes, items)
    counts: Int32 = cast(Any, items.counts).copy_to_host()
    triangles = _triangles(memory, counts)
    places = int(counts[:, NUM_INSTANCES].max())
    lanes, num_objects = num_frames * places * LANES, state.motion.shape[1]
    launch(kernels.place_vertices, lanes, places, is_colored, shots, meshes, look, items, triangles)
    launch(kernels.set_up, lanes, places, size, is_colored, num_objects, shots, meshes, look, items, triangles)
    launch(kernels.bound, num_frames * places, places, items, triangles)
    rows, lit = -(-size[0] // BAND) + 1, num_frames if is_colored else 0
    nodes = memory.buffer("nodes", (lit, rows, 3, size[1] // SKY_STEP + 2), np.float32)
    sky = memory.buffer("sky", (lit, rows, 4, size[1]), np.float32)
    launch(kernels.light, nodes.size // 3, size, shots, look, nodes)
    launch(kernels.stretch, sky.size // 4, nodes, sky)
    launch(
        kernels.draw, num_frames * size[0] * size[1], size, options, shots, solids.motion, ground, look, items,
        triangles, sky, pictures,
    )  # fmt: skip


def _ground_on(memory: DeviceMemory, stage: Stage) -> Ground:
    """Return the ground with its arrays on the card."""
    each_call = {name: memory.put(f"ground_{name}", getattr(stage.ground, name)) for name in Ground._fields[:4]}
    stored = [memory.rows(stage.kinds[kind]) for kind in ("cells", "strokes", "heights")]
    return Ground(**each_call, **stored[0], **stored[1], **stored[2])


def _solids_on(memory: DeviceMemory, batch: WorldBatch, stage: Stage, solids: Solids) -> Solids:
    """Return what stands on the ground with its arrays on the card."""
    each_call = {name: memory.put(name, getattr(solids, name)) for name in _EACH_CALL}
    stored = [
        memory.rows(kinds) for kinds in (stage.kinds["fixed"], batch.pool.kinds["log"], batch.pool.kinds["lights"])
    ]
    light_color = memory.constant(solids.light_color)
    return Solids(**each_call, **stored[0], **stored[1], **stored[2], light_color=light_color)


def _shots_on(memory: DeviceMemory, cameras: Int32, poses: Float64, optics: Optics) -> Shots:
    """Return the cameras with their arrays on the card."""
    return Shots(
        memory.put("owners", cameras), memory.put("poses", poses), memory.put("lens", optics.lens),
        memory.constant(optics.rays), memory.constant(optics.rings),
    )  # fmt: skip


def _items(memory: DeviceMemory, num_frames: int, num_items: int) -> Items:
    """Return memory for the objects and fixtures of all frames."""
    all_items = num_frames, num_items
    return Items(
        boxes=memory.buffer("boxes", (*all_items, NUM_BOX), np.float64),
        kinds=memory.buffer("kinds", (*all_items, NUM_ITEM), np.int32),
        shadows=memory.buffer("shadows", (*all_items, 12), np.float64),
        drawn=memory.buffer("drawn", all_items, np.int32),
        instances=memory.buffer("instances", (*all_items, NUM_INSTANCE), np.int32),
        counts=memory.buffer("counts", (num_frames, NUM_COUNTS), np.int32),
    )


def _triangles(memory: DeviceMemory, counts: Int32) -> Triangles:
    """Return memory for the triangles of all frames, one frame after another."""
    each = counts[:, [NUM_TRIANGLES, NUM_VERTICES]]
    ends = np.cumsum(each, axis=0, dtype=np.int64)
    count, num_vertices = ends[-1].tolist()
    count += 1  # functions of lanes read the first one where a pixel sees none
    return Triangles(
        first=memory.put("first", (ends - each).astype(np.int32)),
        vertices=memory.buffer("vertices", (NUM_VERTEX, num_vertices), np.float64),
        lights=memory.buffer("lights_of_vertices", (NUM_LIGHTS, num_vertices), np.float32),
        edges=memory.buffer("edges", (count, 12), np.float64),
        spans=memory.buffer("spans", (count, 12), np.float64),
        colors=memory.buffer("colors", (count, 12), np.float32),
        labels=memory.buffer("labels", (count, 3), np.int32),
        bounds=memory.buffer("bounds", (count, 4), np.int32),
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
