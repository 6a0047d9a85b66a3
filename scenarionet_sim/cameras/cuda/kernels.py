"""The CUDA kernels: each thread calls one function of ``cameras.draw.thread_items`` or ``finishing``.

Importing this module needs numba-cuda; the kernels compile at their first launch in a process.
"""

from __future__ import annotations

import warnings
from typing import Any

import numba.cuda
from numba import float32, int32

from scenarionet_data.arrays.dtypes import Float32, Float64, UInt8
from scenarionet_sim.cameras.draw.finishing import noisy_level, root_mean_square
from scenarionet_sim.cameras.draw.layout import NUM_SHADES, Ground, Look, Meshes, Pictures, Solids
from scenarionet_sim.cameras.draw.thread_items import bound_instance, find_item, list_items, place_part, set_up_part
from scenarionet_sim.cameras.draw.thread_layout import DrawingOptions, Items, PixelMemory, Shots, Triangles
from scenarionet_sim.cameras.draw.thread_pixels import draw_pixel, light_sky, stretch_sky

cuda: Any = numba.cuda

THREADS = 128
"""Threads of a block."""

LANES = 32
"""Threads that share the triangles of an instance."""

_SHADES = NUM_SHADES, 1


def launch(kernel: Any, count: int, *arguments: object) -> None:
    """Run a kernel in ``count`` threads."""
    if count:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Grid size")  # small pictures do not fill a card
            configured = kernel[-(-count // THREADS), THREADS]
        configured(count, *arguments)


@cuda.jit
def find(
    count: int, num_items: int, size: tuple[int, int], options: DrawingOptions, shots: Shots, solids: Solids,
    ground: Ground, meshes: Meshes, look: Look, items: Items,
) -> None:  # fmt: skip
    """One thread for each of ``num_items`` objects and fixtures of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        find_item(thread // num_items, thread % num_items, size, options, shots, solids, ground, meshes, look, items)


@cuda.jit
def list_found(count: int, meshes: Meshes, items: Items) -> None:
    """One thread for each frame."""
    frame = cuda.grid(1)
    if frame < count:
        list_items(frame, meshes, items)


@cuda.jit
def place_vertices(
    count: int, num_places: int, is_colored: bool, shots: Shots, meshes: Meshes, look: Look, items: Items,
    triangles: Triangles,
) -> None:  # fmt: skip
    """``LANES`` threads for each of ``num_places`` instances of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        lane, place, frame = thread % LANES, thread // LANES % num_places, thread // LANES // num_places
        if place < items.counts[frame, 0]:
            place_part(frame, place, lane, LANES, is_colored, shots, meshes, look, items, triangles)


@cuda.jit
def set_up(
    count: int, num_places: int, size: tuple[int, int], is_colored: bool, num_objects: int, shots: Shots,
    meshes: Meshes, look: Look, items: Items, triangles: Triangles,
) -> None:  # fmt: skip
    """``LANES`` threads for each of ``num_places`` instances of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        lane, place, frame = thread % LANES, thread // LANES % num_places, thread // LANES // num_places
        if place < items.counts[frame, 0]:
            set_up_part(frame, place, lane, LANES, size, is_colored, num_objects, shots, meshes, look, items, triangles)


@cuda.jit
def bound(count: int, num_places: int, items: Items, triangles: Triangles) -> None:
    """One thread for each of ``num_places`` instances of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        frame, place = thread // num_places, thread % num_places
        if place < items.counts[frame, 0]:
            bound_instance(frame, place, items, triangles)


@cuda.jit
def light(count: int, size: tuple[int, int], shots: Shots, look: Look, nodes: Float32) -> None:
    """One thread for each node of the sky of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        num_rows, num_nodes = nodes.shape[1], nodes.shape[3]
        row = thread // num_nodes
        light_sky(row // num_rows, row % num_rows, thread % num_nodes, size, shots, look, nodes)


@cuda.jit
def stretch(count: int, nodes: Float32, sky: Float32) -> None:
    """One thread for each column of the rows of the sky of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        num_rows, width = sky.shape[1], sky.shape[3]
        row = thread // width
        stretch_sky(row // num_rows, row % num_rows, thread % width, nodes, sky)


@cuda.jit
def draw(
    count: int, size: tuple[int, int], options: DrawingOptions, shots: Shots, motion: Float64, ground: Ground,
    look: Look, items: Items, triangles: Triangles, sky: Float32, pictures: Pictures,
) -> None:  # fmt: skip
    """One thread for each pixel of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        height, width = size
        memory = PixelMemory(
            cuda.local.array(1, float32), cuda.local.array(1, int32), cuda.local.array(_SHADES, float32),
            cuda.local.array(1, int32), cuda.local.array(1, int32),
        )  # fmt: skip
        row = thread // width
        draw_pixel(
            row // height, row % height, thread % width, size, options, shots, motion, ground, look, items, triangles,
            sky, memory, pictures,
        )  # fmt: skip


@cuda.jit
def shrink(count: int, fine: UInt8, factor: int, pictures: UInt8) -> None:
    """One thread for each pixel of pictures (B, H, W, 3)."""
    thread = cuda.grid(1)
    if thread < count:
        height, width = pictures.shape[1], pictures.shape[2]
        row, column = thread // width, thread % width
        for channel in range(3):
            pictures[row // height, row % height, column, channel] = root_mean_square(
                fine[row // height], row % height * factor, column * factor, channel, factor
            )


@cuda.jit
def add_noise(count: int, spread: float, seed: int, levels: UInt8) -> None:
    """One thread for each of the levels (count,)."""
    thread = cuda.grid(1)
    if thread < count:
        levels[thread] = noisy_level(levels[thread], spread, seed, thread)
