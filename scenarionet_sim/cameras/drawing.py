"""Frames of cameras anywhere in the worlds of a batch: one call of the kernel for all of them, in threads."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.checking import unchecked
from scenarionet_sim.cameras.draw.frames import draw_frames
from scenarionet_sim.cameras.draw.layout import (
    BAND,
    BANDS,
    GROUP,
    LANES,
    NUM_INSTANCE,
    NUM_LIGHTS,
    NUM_POSE,
    NUM_SHADES,
    NUM_VERTEX,
    SKY_STEP,
    TILE,
    FrameMemory,
    Look,
    Pictures,
)
from scenarionet_sim.cameras.draw.mounting import mount_cameras
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.stage import Scenery, stage_of
from scenarionet_sim.threads import Threads
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

CHANNELS: dict[str, tuple[int, type[np.generic]]] = {
    "rgb": (3, np.uint8),
    "depth": (1, np.float32),
    "semantic": (1, np.uint8),
    "instance": (1, np.int32),
    "normals": (3, np.float32),
    "flow": (2, np.float32),
}
"""Channels: numbers per pixel and their type."""

TAILS = {name: (numbers,) if numbers > 1 else () for name, (numbers, _) in CHANNELS.items()}


def shape_of_channel(name: str, num_pixels: int) -> tuple[int, ...]:
    """Return the shape of a channel of a frame, see ``Pictures``."""
    return (3 * num_pixels,) if name == "rgb" else (num_pixels, *TAILS[name])


_NO_PICTURES = Pictures(*(np.empty((0, *shape_of_channel(name, 0)), kind) for name, (_, kind) in CHANNELS.items()))

MAX_TRIANGLES = 200_000
_MAX_VERTICES = 2_000
_MAX_INSTANCES = 2_000

_LISTED = 32 * GROUP
"""Objects or fixtures that are listed at a time."""


@dataclass(frozen=True, eq=False)
class Optics:
    """What all cameras of a call have in common.

    Attributes:
        lens: (NUM_LENS,) see ``cameras.lenses``.
        width, height: [pixels].
        reach: Farthest visible distance along a ray [m].
        are_boxes: Whether objects are their boxes instead of meshes.
        flow_time: Time between the two pictures of the flow [s].
        rays: (H, W, 3) see ``cameras.lenses.rays_of``; read-only.
        rings: (H,) descending slopes of a lidar's rings.
    """

    lens: Float64
    width: int
    height: int
    reach: float
    are_boxes: bool
    flow_time: float
    rays: Float64
    rings: Float64


def draw(
    batch: WorldBatch,
    state: State,
    cameras: Int32,
    poses: Float64,
    optics: Optics,
    look: Look,
    scenery: Scenery,
    channels: Sequence[str],
    threads: int = 1,
) -> dict[str, Array]:
    """Draw the frames of B cameras.

    Args:
        batch, state: The worlds and their current state.
        cameras: (B, 3) int32 slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) see ``cameras.draw.layout``; heights are the scenario's.
        optics: Lens, size and reach.
        look: Light of each frame.
        scenery: What surrounds the roads.
        channels: Names in ``CHANNELS``.
        threads: Largest number of threads; the result does not depend on it.

    Returns:
        Arrays (B, H, W) or (B, H, W, numbers) by channel.
    """
    count, (height, width) = len(cameras), (optics.height, optics.width)
    made = {name: np.empty((count, *shape_of_channel(name, height * width)), CHANNELS[name][1]) for name in channels}
    pictures, stage = _NO_PICTURES._replace(**made), stage_of(batch, scenery)
    solids, meshes, ground = stage.solids(batch, state), library(), stage.ground
    options = optics.are_boxes, optics.reach, optics.flow_time

    def draw_parts(_: int, first: int, end: int) -> int:
        return unchecked(draw_frames)(
            first, end, cameras, poses, optics.lens, optics.rays, optics.rings, (height, width), options, solids,
            ground, meshes, look, _scratch(width), pictures,
        )  # fmt: skip

    if count:
        _threads(threads).run(draw_parts, count * -(-height // (BAND * BANDS)))
    return {name: values.reshape(count, height, width, *TAILS[name]) for name, values in made.items()}


@lru_cache
def _threads(count: int) -> Threads:
    return Threads(count)


_memory = threading.local()


def _scratch(width: int) -> FrameMemory:
    """Return the memory of this thread for rows of some width."""
    columns = max(width, 16)
    found: FrameMemory | None = getattr(_memory, "scratch", None)
    if found is None or len(found.near) < BAND * columns:
        found = _memory.scratch = FrameMemory(
            vertices=np.zeros((NUM_VERTEX, _MAX_VERTICES)),
            lights=np.zeros((NUM_LIGHTS, _MAX_VERTICES), np.float32),
            edges=np.empty((MAX_TRIANGLES, 12)),
            spans=np.empty((MAX_TRIANGLES, 12)),
            colors=np.zeros((MAX_TRIANGLES, 12), np.float32),
            labels=np.empty((MAX_TRIANGLES, 3), np.int32),
            bounds=np.empty((MAX_TRIANGLES, 4), np.int32),
            instances=np.empty((_MAX_INSTANCES, NUM_INSTANCE), np.int32),
            shadows=np.empty((_MAX_INSTANCES, 12)),
            places=np.zeros((2, BAND), np.int32),
            near=np.empty(BAND * columns, np.float32),
            seen=np.empty(BAND * columns, np.int32),
            shades=np.zeros((NUM_SHADES, TILE + LANES), np.float32),
            cells=np.zeros(TILE, np.int32),
            texels=np.zeros(TILE, np.int32),
            box=np.zeros(7),
            radii=np.empty(_LISTED, np.float32),
            has_shadow=np.empty(_LISTED, np.int32),
            listed=np.empty(_LISTED, np.int32),
            nodes=np.zeros((3, columns // SKY_STEP + 2 + LANES), np.float32),
            sky=np.zeros((2, 4, columns + SKY_STEP), np.float32),
        )
    return found


def poses_on(
    batch: WorldBatch, state: State, agents: Int32, place: tuple[float, float, float], turns: Float64
) -> Float64:
    """Return the poses (A, NUM_POSE) of a camera mounted on each agent.

    Args:
        batch, state: The worlds and their current state.
        agents: (A, 2) int32 slot and row.
        place: x forward, y left of the middle of the box, z above the ground [m].
        turns: (A, 3) yaw counter-clockwise from straight ahead, pitch upwards and roll clockwise as seen by the camera
            [rad].
    """
    poses, heights = np.empty((len(agents), NUM_POSE)), np.zeros(len(agents))
    if any(world.heights is not None for world in batch.worlds):
        heights = ground_heights(batch, agents[:, 0], state.motion[agents[:, 0], agents[:, 1], :2])
    mount_cameras(state.motion, agents, place, turns, heights, poses)
    return poses


def ground_heights(batch: WorldBatch, slots: Array, points: Float64) -> Float64:
    """Return the height of the ground (A,) at points (A, 2) of the worlds in some slots [m]."""
    heights = np.zeros(len(points))
    for slot in np.unique(slots).tolist():
        grid = batch.worlds[slot].heights
        if grid is not None:
            heights[slots == slot] = grid.at(points[slots == slot])
    return heights


def scaled_down(rgb: UInt8, factor: int) -> UInt8:
    """Return pictures (B, H, W, 3) as the means of squares of pixels, for smooth edges."""
    count, height, width, _ = rgb.shape
    blocks: Float32 = rgb.reshape(count, height // factor, factor, width // factor, factor, 3).astype(np.float32)
    means: UInt8 = np.rint(np.sqrt((blocks**2).mean(axis=(2, 4)))).astype(np.uint8)
    return means
