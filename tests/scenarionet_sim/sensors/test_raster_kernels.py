"""Rasterised polygons and lines, against shapely and plain loops."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_sim.sensors.raster_kernels import Crossings, draw_boxes, draw_polygons, draw_segments

IDENTITY = np.array([1.0, 0, 0, 0, 1.0, 0])
STYLE = np.tile(np.array([0, 9], np.int16), (256, 1))  # channel 0, value 9
HEIGHT, WIDTH = 40, 50


def filled(outline):
    """Return the image of one polygon."""
    picture = np.zeros((1, HEIGHT, WIDTH), np.uint8)
    crossings = Crossings.none(HEIGHT, WIDTH)
    points = np.asarray(outline, np.float32)
    offsets, one = np.array([0, len(points)], np.int32), np.ones(1, np.uint8)
    bounds = np.concatenate(Ragged(offsets, points).bounds(), axis=1)
    draw_polygons(points, offsets, one, bounds, STYLE, IDENTITY, picture, crossings)
    assert not crossings.rows[:, 0].any() and not crossings.turns.any(), "scratch memory must be restored"
    return picture[0]


@given(st.integers(0, 10**6), st.integers(3, 9))
def test_polygon_covers_the_pixels_whose_centres_it_contains(seed, count):
    """Star-shaped polygons of any size, including beyond the borders of the image."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    radii = rng.uniform(2, 40, count)
    outline = rng.uniform(-5, 45, 2) + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    outline = outline.astype(np.float32).astype(float)[:: rng.choice([-1, 1])]
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid:
        return
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    np.testing.assert_array_equal(filled(outline) == 9, shapely.contains_xy(polygon, columns, rows))


def test_self_overlapping_outline_has_no_hole():
    """Twice around the same square."""
    square = [[5, 5], [20, 5], [20, 20], [5, 20]]
    assert (filled(square * 2) == 9).sum() == 15 * 15


def test_adjacent_polygons_cover_each_pixel_once():
    """Half an image each, divided by a slanted line."""
    left = filled([[0, 0], [13.3, 0], [31.7, HEIGHT], [0, HEIGHT]])
    right = filled([[13.3, 0], [WIDTH, 0], [WIDTH, HEIGHT], [31.7, HEIGHT]])
    np.testing.assert_array_equal((left == 9).astype(int) + (right == 9), 1)


@pytest.mark.parametrize("outline", [[[3, 3]], [[3, 3], [9, 9]], [[3, 3], [9, 3], [20, 3]], []])
def test_polygon_without_area_covers_nothing(outline):
    assert not filled(np.reshape(outline, (-1, 2))).any()


def test_outlines_that_cross_rows_often():
    """A comb: most rows are crossed ten times."""
    slots = [[[x, 5], [x, 30], [x + 3, 30], [x + 3, 5]] for x in (4, 14, 24, 34)]
    outline = [[2.1, 35], *[point for slot in slots for point in slot], [45, 5], [45, 35]]
    centres = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    expected = shapely.contains_xy(shapely.Polygon(outline), *centres)
    np.testing.assert_array_equal(filled(outline) == 9, expected)


def test_box_covers_the_pixels_whose_centres_it_contains():
    motion, size = (
        np.array([[20.3, 15.2, 0.0, 0.7], [5.0, 5.0, 0.0, 0.0]]),
        np.array([[12.0, 5.0, 2.0], [4.0, 4.0, 1.0]]),
    )
    picture = np.zeros((1, HEIGHT, WIDTH), np.uint8)
    drawn = np.array([True, False])
    draw_boxes(motion, size, np.zeros(2, np.uint8), drawn, STYLE, IDENTITY, picture, Crossings.none(HEIGHT, WIDTH))
    box = shapely.Polygon(box_corners(motion[0, :2], motion[0, 3], size[0, 0], size[0, 1]))
    centres = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    np.testing.assert_array_equal(picture[0] == 9, shapely.contains_xy(box, *centres))


@given(st.integers(0, 10**6), st.sampled_from([5, 40, 400]))
def test_line_is_one_pixel_wide(seed, scale):
    """Both ends, and one pixel per column (row, if steep) whose centre it crosses."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = (25 + rng.uniform(-scale, scale, 4)).astype(np.float32).astype(float)
    picture = np.zeros((1, HEIGHT, WIDTH), np.uint8)
    one = np.ones(1, np.uint8)
    segment = np.array([[x0, y0, x1, y1]], np.float32)
    draw_segments(segment, one, STYLE, IDENTITY, picture)
    pixels = {(int(np.floor(y)), int(np.floor(x))) for x, y in ((x0, y0), (x1, y1))}
    if abs(y1 - y0) > abs(x1 - x0):
        middles = np.arange(HEIGHT)[(min(y0, y1) <= np.arange(HEIGHT) + 0.5) & (np.arange(HEIGHT) + 0.5 < max(y0, y1))]
        pixels |= {(int(r), int(np.floor(x0 + (r + 0.5 - y0) * (x1 - x0) / (y1 - y0)))) for r in middles}
    else:
        middles = np.arange(WIDTH)[(min(x0, x1) <= np.arange(WIDTH) + 0.5) & (np.arange(WIDTH) + 0.5 < max(x0, x1))]
        pixels |= {(int(np.floor(y0 + (c + 0.5 - x0) * (y1 - y0) / (x1 - x0))), int(c)) for c in middles}
    inside = {(row, column) for row, column in pixels if 0 <= row < HEIGHT and 0 <= column < WIDTH}
    assert set(zip(*map(np.ndarray.tolist, np.nonzero(picture[0])), strict=True)) == inside
