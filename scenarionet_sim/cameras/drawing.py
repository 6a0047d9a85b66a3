"""Frames of cameras anywhere in the worlds of a batch: one call of the kernel for all of them, in threads."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32, Int64, UInt8
from scenarionet_sim.cameras.lenses import rays_of
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.stage import Scenery, stage_of
from scenarionet_sim.kernels.cameras.frames import draw_frames
from scenarionet_sim.kernels.cameras.layout import (
    BAND,
    EYE,
    FORWARD,
    NUM_LIGHTS,
    NUM_POSE,
    NUM_SHADES,
    NUM_VERTEX,
    PIVOT,
    RIGHT,
    SKY_STEP,
    TILE,
    VELOCITY,
    YAW_SPEED,
    FrameMemory,
    Look,
    Pictures,
)
from scenarionet_sim.kernels.log import HEADING, VX, YAW_RATE, X, Y
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

MAX_TRIANGLES = 200_000
_MAX_VERTICES = 2_000
_MAX_INSTANCES = 2_000


@dataclass(frozen=True, eq=False)
class Optics:
    """What all cameras of a call have in common.

    Attributes:
        lens: (NUM_LENS,) see ``cameras.lenses``.
        width, height: [pixels].
        reach: Farthest visible distance along a ray [m].
        are_boxes: Whether objects are their boxes instead of meshes.
        flow_time: Time between the two pictures of the flow [s].
    """

    lens: Float64
    width: int
    height: int
    reach: float
    are_boxes: bool = False
    flow_time: float = 0.1
    rings: Float64 | None = None
    rays: Float64 | None = None


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
        poses: (B, NUM_POSE) see ``kernels.cameras.layout``; heights are the scenario's.
        optics: Lens, size and reach.
        look: Light of each frame.
        scenery: What surrounds the roads.
        channels: Names in ``CHANNELS``.
        threads: Largest number of threads; the result does not depend on it.

    Returns:
        Arrays (B, H, W) or (B, H, W, numbers) by channel.
    """
    count, (height, width) = len(cameras), (optics.height, optics.width)
    made: dict[str, Array] = {}
    for name, (numbers, dtype) in CHANNELS.items():
        tail = (numbers,) if numbers > 1 else ()
        made[name] = np.empty((count if name in channels else 0, height, width, *tail), dtype)
    stage = stage_of(batch, scenery)
    bands = -(-height // BAND)
    order: Int64 = np.concatenate([np.arange(start, bands, threads) for start in range(threads)])
    rays = rays_of(tuple(optics.lens.tolist()), width, height) if optics.rays is None else optics.rays
    rings = np.zeros(0) if optics.rings is None else optics.rings
    pictures = Pictures(**{
        name: picture.reshape(len(picture), height * width, *picture.shape[3:]) for name, picture in made.items()
    })  # fmt: skip
    solids, meshes = stage.solids(batch, state), library()
    options = optics.are_boxes, optics.reach, optics.flow_time

    def draw_bands(first: int, end: int) -> int:
        draw_frames(
            first, end, order, cameras, poses, optics.lens, rays, rings, (height, width), options, solids, stage.ground,
            meshes, look, _scratch(width), pictures,
        )  # fmt: skip
        return end - first

    if count:
        _threads(threads).run(draw_bands, count * bands)
    return {name: made[name] for name in channels}


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
            instances=np.empty((_MAX_INSTANCES, 4), np.int32),
            shadows=np.empty((_MAX_INSTANCES, 12)),
            near=np.empty(BAND * columns, np.float32),
            seen=np.empty(BAND * columns, np.int32),
            shades=np.zeros((NUM_SHADES, TILE), np.float32),
            cells=np.zeros(TILE, np.int32),
            texels=np.zeros((3, TILE), np.int32),
            box=np.zeros(7),
            sky=np.zeros((2, columns // SKY_STEP + 2, 4), np.float32),
        )
    return found


def axes_of(yaw: Float64, pitch: Float64, roll: Float64) -> Float64:
    """Return the axes right, down and ahead (B, 3, 3) of cameras.

    Args:
        yaw: (B,) counter-clockwise from +x [rad].
        pitch: (B,) upwards [rad].
        roll: (B,) clockwise as seen by the camera [rad].
    """
    zero = np.zeros_like(yaw)
    ahead = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], axis=1)
    level = np.stack([np.sin(yaw), -np.cos(yaw), zero], axis=1)
    below = np.stack([np.sin(pitch) * np.cos(yaw), np.sin(pitch) * np.sin(yaw), -np.cos(pitch)], axis=1)
    cos, sin = np.cos(roll)[:, None], np.sin(roll)[:, None]
    return np.stack([cos * level + sin * below, cos * below - sin * level, ahead], axis=1)


def poses_on(
    batch: WorldBatch,
    state: State,
    agents: Int32,
    place: tuple[float, float, float],
    yaw: Float64,
    pitch: Float64,
    roll: Float64,
) -> Float64:
    """Return the poses (A, NUM_POSE) of a camera mounted on each agent.

    Args:
        batch, state: The worlds and their current state.
        agents: (A, 2) slot and row.
        place: x forward, y left of the middle of the box, z above the ground [m].
        yaw, pitch, roll: (A,) see :func:`axes_of`, yaw from straight ahead [rad].
    """
    x, y, z = place
    motion = state.motion[agents[:, 0], agents[:, 1]]
    heading = motion[:, HEADING]
    cos, sin = np.cos(heading), np.sin(heading)
    poses = np.zeros((len(agents), NUM_POSE))
    poses[:, EYE], poses[:, EYE + 1] = motion[:, X] + cos * x - sin * y, motion[:, Y] + sin * x + cos * y
    poses[:, EYE + 2] = z + ground_heights(batch, agents[:, 0], motion[:, :2])
    poses[:, RIGHT : FORWARD + 3] = axes_of(heading + yaw, pitch, roll).reshape(-1, 9)
    poses[:, VELOCITY : VELOCITY + 2], poses[:, YAW_SPEED] = motion[:, VX : VX + 2], motion[:, YAW_RATE]
    poses[:, PIVOT : PIVOT + 2] = motion[:, :2]
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
