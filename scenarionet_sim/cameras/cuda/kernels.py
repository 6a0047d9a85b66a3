"""The CUDA kernels: each thread calls one function of ``items``, ``pixels`` or ``draw.post_processing``.

Importing this module needs numba-cuda; the kernels compile at their first launch in a process.
"""

from __future__ import annotations

import warnings
from typing import Any

import numba.cuda
from numba import float32, float64, int32

from scenarionet_data.arrays.dtypes import Float32, UInt8
from scenarionet_sim.cameras.cuda.items import LANES, Items, bound_instance, find_item, list_items, set_up_part
from scenarionet_sim.cameras.cuda.pixels import draw_pixel, light_sky, stretch_sky
from scenarionet_sim.cameras.draw.columns import NUM_LIGHTS, NUM_SHADES, NUM_VERTEX
from scenarionet_sim.cameras.draw.post_processing import noisy_level, root_mean_square
from scenarionet_sim.cameras.draw.structures import BAND, Look, Pictures, SceneArrays, Shots, Tile, Triangles, Vertices

cuda: Any = numba.cuda

THREADS = 128
"""Threads of a block."""

_SHADES, _PLACES, _LIGHTS = (NUM_SHADES, 1), (NUM_VERTEX, 3), (NUM_LIGHTS, 3)


def launch(kernel: Any, count: int, *arguments: object) -> None:
    """Run a kernel in ``count`` threads."""
    if count:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*Grid size")  # in bold; small pictures do not fill a card
            configured = kernel[-(-count // THREADS), THREADS]
        configured(count, *arguments)


@cuda.jit
def find(count: int, num_items: int, shots: Shots, scene: SceneArrays, items: Items) -> None:
    """One thread for each of ``num_items`` objects and fixtures of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        find_item(thread // num_items, thread % num_items, shots, scene, items)


@cuda.jit
def list_found(count: int, scene: SceneArrays, items: Items) -> None:
    """One thread for each frame."""
    frame = cuda.grid(1)
    if frame < count:
        list_items(frame, scene, items)


@cuda.jit
def set_up(count: int, num_places: int, shots: Shots, scene: SceneArrays, items: Items, triangles: Triangles) -> None:
    """``LANES`` threads for each of ``num_places`` instances of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        vertices = Vertices(cuda.local.array(_PLACES, float64), cuda.local.array(_LIGHTS, float32))
        lane, place, frame = thread % LANES, thread // LANES % num_places, thread // LANES // num_places
        if place < items.counts[frame, 0]:
            set_up_part(frame, place, lane, shots, scene, items, vertices, triangles)


@cuda.jit
def bound(count: int, num_places: int, items: Items, triangles: Triangles) -> None:
    """One thread for each of ``num_places`` instances of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        frame, place = thread // num_places, thread % num_places
        if place < items.counts[frame, 0]:
            bound_instance(frame, place, items, triangles)


@cuda.jit
def light(count: int, shots: Shots, look: Look, nodes: Float32) -> None:
    """One thread for each node of the sky of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        num_rows, num_nodes = nodes.shape[1], nodes.shape[3]
        row = thread // num_nodes
        light_sky(row // num_rows, row % num_rows, thread % num_nodes, shots, look, nodes)


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
    count: int, shots: Shots, scene: SceneArrays, items: Items, triangles: Triangles, sky: Float32, pictures: Pictures
) -> None:
    """One thread for each pixel of every frame."""
    thread = cuda.grid(1)
    if thread < count:
        frame, number = thread // (shots.height * shots.width), thread % (shots.height * shots.width)
        shades, band = cuda.local.array(_SHADES, float32), number // shots.width // BAND
        tile = Tile(
            cuda.local.array(1, float32), cuda.local.array(1, int32), shades, cuda.local.array(1, int32),
            cuda.local.array(1, int32), shades, sky[frame, band : band + 2],
        )  # fmt: skip
        draw_pixel(frame, number, shots, scene, items, triangles, tile, pictures)


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
