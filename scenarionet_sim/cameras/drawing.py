"""Frames of cameras anywhere in the worlds of a batch: one call of the kernel for all of them, in threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64, Int32, Int64, UInt8
from scenarionet_data.compiled.checking import unchecked
from scenarionet_sim.cameras.channels import CHANNELS, shape_of_channel, tail_of_channel
from scenarionet_sim.cameras.draw.columns import NUM_INSTANCE, NUM_LIGHTS, NUM_POSE, NUM_SHADES, NUM_VERTEX
from scenarionet_sim.cameras.draw.frames import draw_frames
from scenarionet_sim.cameras.draw.mounting import mount_cameras
from scenarionet_sim.cameras.draw.post_processing import shrink
from scenarionet_sim.cameras.draw.shadows import NUM_SHADOW
from scenarionet_sim.cameras.draw.structures import (
    BAND,
    BANDS,
    GROUP,
    LANES,
    SKY_STEP,
    TILE,
    FrameMemory,
    Look,
    Pictures,
    SceneArrays,
    Shots,
    Tile,
    Triangles,
    Vertices,
)
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.stage import Scenery, stage_of
from scenarionet_sim.threads.team import Threads
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

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


class Rig(NamedTuple):
    """The B cameras of a call.

    Attributes:
        owners: (B, 3) int32 slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) see ``cameras.draw.columns``; heights are the scenario's.
        look: Light of each frame.
        scenery: What surrounds the roads.
    """

    owners: Int32
    poses: Float64
    look: Look
    scenery: Scenery


def shots_of(rig: Rig, optics: Optics, channels: Sequence[str]) -> Shots:
    """Return cameras and lens as kernels take them."""
    return Shots(
        rig.owners, rig.poses, optics.lens, optics.rays, optics.rings, optics.width, optics.height, optics.reach,
        optics.flow_time, optics.are_boxes, "rgb" in channels,
    )  # fmt: skip


def pictures_for(
    make: Callable[[tuple[int, ...], type[np.generic]], Any], count: int, optics: Optics, channels: Sequence[str]
) -> Pictures:
    """Return arrays for the frames of channels that are wanted, made by a function of shape and type."""
    num_pixels = optics.width * optics.height
    wanted = {name: count if name in channels else 0 for name in CHANNELS}
    return tuple(make((wanted[name], *shape_of_channel(name, num_pixels)), CHANNELS[name][1]) for name in CHANNELS)


def draw(
    batch: WorldBatch, state: State, rig: Rig, optics: Optics, channels: Sequence[str], threads: int = 1
) -> dict[str, Array]:
    """Draw the frames of B cameras.

    Args:
        batch, state: The worlds and their current state.
        rig: The cameras.
        optics: Lens, size and reach.
        channels: Names in ``CHANNELS``.
        threads: Largest number of threads; the result does not depend on it.

    Returns:
        Arrays (B, H, W) or (B, H, W, numbers) by channel.
    """
    count, (height, width) = len(rig.owners), (optics.height, optics.width)
    pictures, stage = pictures_for(np.empty, count, optics, channels), stage_of(batch, rig.scenery)
    shots, scene = (
        shots_of(rig, optics, channels),
        SceneArrays(stage.solids(batch, state), stage.ground, library(), rig.look),
    )

    def draw_parts(own: int, ranges: Int64) -> None:
        unchecked(draw_frames)(own, ranges, shots, scene, _scratch(width), pictures)

    if count:
        _threads(threads).spread(draw_parts, count * -(-height // (BAND * BANDS)))
    made = dict(zip(CHANNELS, pictures, strict=True))
    return {name: made[name].reshape(count, height, width, *tail_of_channel(name)) for name in channels}


def triangles_for(make: Callable[[str, tuple[int, ...], type[np.generic]], Any], count: int) -> Triangles:
    """Return memory for triangles, made by a function of name, shape and type."""
    return Triangles(
        edges=make("edges", (count, 12), np.float64),
        spans=make("spans", (count, 12), np.float64),
        colors=make("colors", (count, 12), np.float32),
        labels=make("labels", (count, 3), np.int32),
        bounds=make("bounds", (count, 4), np.int32),
    )


@lru_cache
def _threads(count: int) -> Threads:
    return Threads(count)


_memory = threading.local()


def _scratch(width: int) -> FrameMemory:
    """Return the memory of this thread for rows of some width."""
    columns = max(width, 16)
    found: FrameMemory | None = getattr(_memory, "scratch", None)
    if found is None or len(found.band.near) < BAND * columns:
        found = _memory.scratch = FrameMemory(
            vertices=Vertices(np.zeros((NUM_VERTEX, _MAX_VERTICES)), np.zeros((NUM_LIGHTS, _MAX_VERTICES), np.float32)),
            triangles=triangles_for(lambda _, shape, dtype: np.empty(shape, dtype), MAX_TRIANGLES),
            instances=np.empty((_MAX_INSTANCES, NUM_INSTANCE), np.int32),
            shadows=np.empty((_MAX_INSTANCES, NUM_SHADOW)),
            places=np.zeros((2, BAND), np.int32),
            band=Tile(
                near=np.empty(BAND * columns, np.float32),
                seen=np.empty(BAND * columns, np.int32),
                shades=np.zeros((NUM_SHADES, TILE + LANES), np.float32),
                cells=np.zeros(TILE, np.int32),
                texels=np.zeros(TILE, np.int32),
                nodes=np.zeros((3, columns // SKY_STEP + 2 + LANES), np.float32),
                sky=np.zeros((2, 4, columns + SKY_STEP), np.float32),
            ),
            box=np.zeros(7),
            radii=np.empty(_LISTED, np.float32),
            has_shadow=np.empty(_LISTED, np.int32),
            listed=np.empty(_LISTED, np.int32),
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
    count, height, width = len(rgb), rgb.shape[1] // factor, rgb.shape[2] // factor
    fine = rgb[:, : height * factor, : width * factor].reshape(count, height * factor, -1)
    made: UInt8 = np.empty((count, height, width * 3), np.uint8)
    shrink(fine, factor, np.empty(fine.shape[2], np.int32), made)
    return made.reshape(count, height, width, 3)
