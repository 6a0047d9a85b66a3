"""The threads of the graphics card one after another, compiled for the processor: pictures of full size in seconds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.cameras.cuda.items import LANES, bound_instance, find_item, list_items, set_up_part
from scenarionet_sim.cameras.cuda.pixels import draw_pixel, light_sky, stretch_sky
from scenarionet_sim.cameras.draw.columns import NUM_LIGHTS, NUM_SHADES, NUM_VERTEX
from scenarionet_sim.cameras.draw.post_processing import noisy_level, root_mean_square
from scenarionet_sim.cameras.draw.structures import BAND, Tile, Vertices


@kernel(divides_by_zero=True)
def find(count, num_items, shots, scene, items):
    for thread in range(count):
        find_item(thread // num_items, thread % num_items, shots, scene, items)


@kernel(divides_by_zero=True)
def list_found(count, scene, items):
    for frame in range(count):
        list_items(frame, scene, items)


@kernel(divides_by_zero=True)
def set_up(count, num_places, shots, scene, items, triangles):
    vertices = Vertices(np.empty((NUM_VERTEX, 3)), np.empty((NUM_LIGHTS, 3), np.float32))
    for thread in range(count):
        lane, place, frame = thread % LANES, thread // LANES % num_places, thread // LANES // num_places
        if place < items.counts[frame, 0]:
            set_up_part(frame, place, lane, shots, scene, items, vertices, triangles)


@kernel(divides_by_zero=True)
def bound(count, num_places, items, triangles):
    for thread in range(count):
        if thread % num_places < items.counts[thread // num_places, 0]:
            bound_instance(thread // num_places, thread % num_places, items, triangles)


@kernel(divides_by_zero=True)
def light(count, shots, look, nodes):
    for thread in range(count):
        row = thread // nodes.shape[3]
        light_sky(row // nodes.shape[1], row % nodes.shape[1], thread % nodes.shape[3], shots, look, nodes)


@kernel(divides_by_zero=True)
def stretch(count, nodes, sky):
    for thread in range(count):
        row = thread // sky.shape[3]
        stretch_sky(row // sky.shape[1], row % sky.shape[1], thread % sky.shape[3], nodes, sky)


@kernel(divides_by_zero=True)
def draw(count, shots, scene, items, triangles, sky, pictures):
    num_pixels = shots.height * shots.width
    near, shades = np.empty(1, np.float32), np.empty((NUM_SHADES, 1), np.float32)
    seen, cells, texels = np.empty(1, np.int32), np.empty(1, np.int32), np.empty(1, np.int32)
    for thread in range(count):
        frame, number = thread // num_pixels, thread % num_pixels
        band = number // shots.width // BAND
        tile = Tile(near, seen, shades, cells, texels, shades, sky[frame, band : band + 2])
        draw_pixel(frame, number, shots, scene, items, triangles, tile, pictures)


@kernel
def shrink(count, fine, factor, pictures):
    height, width = pictures.shape[1:3]
    for thread in range(count):
        row, column = thread // width, thread % width
        for channel in range(3):
            pictures[row // height, row % height, column, channel] = root_mean_square(
                fine[row // height], row % height * factor, column * factor, channel, factor
            )


@kernel
def add_noise(count, spread, seed, levels):
    for thread in range(count):
        levels[thread] = noisy_level(levels[thread], spread, seed, thread)


KERNELS = SimpleNamespace(
    find=find,
    list_found=list_found,
    set_up=set_up,
    bound=bound,
    light=light,
    stretch=stretch,
    draw=draw,
    shrink=shrink,
    add_noise=add_noise,
)
