"""Triangles in view: their projection, and the nearest one along the ray of every pixel.

A ray with direction d (right, down, ahead) hits the triangle a, b, c at the weights d.(b x c), d.(c x a), d.(a x b) of
its corners, relative to their sum, if all are positive; the inverse of the distance is their sum over the volume
a.(b x c). This holds for every lens and needs no clipping; with a pinhole the functions are linear along a row.
(Olano, Greer: Triangle scan conversion using 2D homogeneous coordinates, 1997.)
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.outlines import span_of_outline
from scenarionet_sim.cameras.draw.single_precision import single, single_of
from scenarionet_sim.cameras.draw.structures import BAND, FrameMemory, FrameView
from scenarionet_sim.cameras.draw.vertices import NEAREST, STEEP

RayFunction = tuple[float, float, float]
"""A function of the direction of a ray (right, down, ahead): its factors."""

SHORT = 8
"""Longest span of a triangle in a row [pixels] that the processor covers at once."""

WIDE = 0.35
"""Angle [rad] under which a triangle's edges are bent too much by a lens to be bounded by its corners."""


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def bound_triangle(vertices: Float64, a: int, b: int, c: int, view: FrameView, bounds: Int32) -> bool:
    """Write the screen bounds (4,) of a triangle; return whether its corners have places on the screen."""
    kind, width, height = view.lens[at.KIND], view.width, view.height
    bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, width, height
    if kind == codes.RINGS:
        _bound_on_rings(vertices, a, b, c, view.rings, width, bounds)
        return False
    if kind == codes.PINHOLE:
        ahead = vertices[at.VIEW + 2]
        if smaller(ahead[a], smaller(ahead[b], ahead[c])) < NEAREST:
            return False
    elif _is_wide(vertices, a, b) or _is_wide(vertices, b, c) or _is_wide(vertices, c, a):
        return False
    low_x = smaller(vertices[at.COLUMN, a], smaller(vertices[at.COLUMN, b], vertices[at.COLUMN, c]))
    high_x = larger(vertices[at.COLUMN, a], larger(vertices[at.COLUMN, b], vertices[at.COLUMN, c]))
    low_y = smaller(vertices[at.ROW, a], smaller(vertices[at.ROW, b], vertices[at.ROW, c]))
    high_y = larger(vertices[at.ROW, a], larger(vertices[at.ROW, b], vertices[at.ROW, c]))
    if kind == codes.PINHOLE:  # rows and columns whose middle is inside
        bounds[0] = int(smaller(larger(math.ceil(low_x - 0.501), 0.0), width))
        bounds[1] = int(smaller(larger(math.ceil(low_y - 0.501), 0.0), height))
        bounds[2] = int(smaller(larger(math.floor(high_x + 0.501), 0.0), width))
        bounds[3] = int(smaller(larger(math.floor(high_y + 0.501), 0.0), height))
        return True
    pad_x = pad_y = 1.0 + 0.1 * larger(high_x - low_x, high_y - low_y)
    bounds[0] = int(smaller(larger(math.floor(low_x - pad_x), 0.0), width))
    bounds[1] = int(smaller(larger(math.floor(low_y - pad_y), 0.0), height))
    bounds[2] = int(smaller(larger(math.ceil(high_x + pad_x), 0.0), width))
    bounds[3] = int(smaller(larger(math.ceil(high_y + pad_y), 0.0), height))
    return True


@device_function(divides_by_zero=True)
def _is_wide(vertices: Float64, a: int, b: int) -> bool:
    """Whether the camera sees two vertices more than ``WIDE`` apart, or one of them from closer than ``NEAREST``."""
    dot = (
        vertices[at.VIEW, a] * vertices[at.VIEW, b]
        + vertices[at.VIEW + 1, a] * vertices[at.VIEW + 1, b]
        + vertices[at.VIEW + 2, a] * vertices[at.VIEW + 2, b]
    )
    first = vertices[at.VIEW, a] ** 2 + vertices[at.VIEW + 1, a] ** 2 + vertices[at.VIEW + 2, a] ** 2
    second = vertices[at.VIEW, b] ** 2 + vertices[at.VIEW + 1, b] ** 2 + vertices[at.VIEW + 2, b] ** 2
    is_near = smaller(first, second) < NEAREST * NEAREST
    return bool(is_near or dot < math.cos(WIDE) * math.sqrt(first * second))


@device_function(divides_by_zero=True)
def _bound_on_rings(vertices: Float64, a: int, b: int, c: int, slopes: Float64, width: int, bounds: Int32) -> None:
    """Bound a triangle on a lidar's rings (descending slopes); columns may exceed the picture on either side.

    The slope of an edge is a sine wave of the azimuth: between two corners it exceeds theirs by at most the inverse of
    the cosine of half the angle between them, and only away from the level.
    """
    start, low, high = vertices[at.COLUMN, a], 0.0, 0.0
    for corner in (b, c):
        turn = vertices[at.COLUMN, corner] - start
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        low, high = smaller(low, turn), larger(high, turn)
    down = smaller(vertices[at.ROW, a], smaller(vertices[at.ROW, b], vertices[at.ROW, c]))
    up = larger(vertices[at.ROW, a], larger(vertices[at.ROW, b], vertices[at.ROW, c]))
    if high - low > 3.0 or not (down > -STEEP and up < STEEP):  # above or below the lidar
        return
    bend = 1.0 / math.cos(0.5 * (high - low))
    up, down = larger(up, up * bend) + 1e-6, smaller(down, down * bend) - 1e-6
    scale = width / (2.0 * math.pi)
    bounds[0] = math.ceil((start + low) * scale - 1e-3)
    bounds[2] = math.floor((start + high) * scale + 1e-3) + 1
    first, end = 0, len(slopes)
    while first < end and slopes[first] > up:
        first += 1
    while end > first and slopes[end - 1] < down:
        end -= 1
    bounds[1], bounds[3] = first, end


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def add_triangle(
    vertices: Float64, a: int, b: int, c: int, view: FrameView, edges: Float64, spans: Float64, bounds: Int32
) -> int:
    """Write edge functions (12,), spans (12,) and bounds (4,) of a triangle, if it may be in view.

    Returns:
        0 if it is not in view, 2 if its corners have places on the screen, else 1.
    """
    ax, ay, az = vertices[at.VIEW, a], vertices[at.VIEW + 1, a], vertices[at.VIEW + 2, a]
    bx, by, bz = vertices[at.VIEW, b], vertices[at.VIEW + 1, b], vertices[at.VIEW + 2, b]
    cx, cy, cz = vertices[at.VIEW, c], vertices[at.VIEW + 1, c], vertices[at.VIEW + 2, c]
    ex, ey, ez = cy * bz - cz * by, cz * bx - cx * bz, cx * by - cy * bx  # -(b x c)
    volume = ax * ex + ay * ey + az * ez
    if volume <= 1e-12:
        return 0
    is_placed = bound_triangle(vertices, a, b, c, view, bounds)
    if bounds[0] >= bounds[2] or bounds[1] >= bounds[3]:
        return 0
    fx, fy, fz = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx  # -(c x a)
    gx, gy, gz = by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax  # -(a x b)
    scale = 1.0 / volume
    px, py, pz = (ex + fx + gx) * scale, (ey + fy + gy) * scale, (ez + fz + gz) * scale
    if view.lens[at.KIND] == codes.PINHOLE:
        write_spans((ex, ey, ez), (fx, fy, fz), (gx, gy, gz), (px, py, pz), view.lens, spans)
    else:
        edges[0], edges[1], edges[2], edges[3], edges[4], edges[5] = ex, ey, ez, fx, fy, fz
        edges[6], edges[7], edges[8], edges[9], edges[10], edges[11] = gx, gy, gz, px, py, pz
    return 2 if is_placed else 1


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def trace_band(top: int, end: int, num_instances: int, view: FrameView, scratch: FrameMemory) -> None:
    """Find the nearest triangle along the ray of every pixel of a band of rows."""
    near, seen, instances, places = scratch.band.near, scratch.band.seen, scratch.instances, scratch.places
    triangles, width = scratch.triangles, view.width
    for k in range((end - top) * width):
        near[k] = 0.0
    for k in range((end - top) * width):
        seen[k] = -1
    is_pinhole = view.lens[at.KIND] == codes.PINHOLE
    for place in range(num_instances):
        if instances[place, at.TOP] >= end or instances[place, at.BOTTOM] <= top:
            continue
        is_outline = instances[place, at.IS_OUTLINE] > 0
        for triangle in range(instances[place, at.TRI_FIRST], instances[place, at.TRI_END]):
            bounds, spans = triangles.bounds[triangle], triangles.spans[triangle]
            first, last = larger(int(bounds[1]), top), smaller(int(bounds[3]), end)
            if first >= last:
                continue
            if is_pinhole:
                _list_spans(top, is_outline, bounds, spans, places[0], places[1])
            for row in range(first, last):
                start = (row - top) * width
                if not is_pinhole:
                    _test(triangle, row, start, view, triangles.edges[triangle], bounds, near, seen)
                elif places[0, row - top] < places[1, row - top]:
                    left, right = int(places[0, row - top]), int(places[1, row - top])
                    inverse = spans[9] + spans[11] * row + spans[10] * left
                    _cover(triangle, start + left, start + right, single(inverse), single(spans[10]), near, seen)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _list_spans(top: int, is_outline: bool, bounds: Int32, spans: Float64, lefts: Int32, rights: Int32) -> None:
    """Write the first columns and the ends of a triangle in all rows of a band."""
    first, last = bounds[0] * 1.0, bounds[2] * 1.0
    if is_outline:
        for k in range(BAND):
            left, right = span_of_outline(bounds, spans, top + k)
            lefts[k], rights[k] = smaller(left, last), larger(right, first)
    else:
        for k in range(BAND):
            left, right = span_of(bounds, spans, top + k)
            lefts[k], rights[k] = smaller(left, last), larger(right, first)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def span_of(bounds: Int32, spans: Float64, row: int) -> tuple[float, float]:
    """Return the first column and the end of a triangle in a row of a pinhole's picture, from its bounds and spans."""
    left, right = bounds[0] * 1.0, bounds[2] * 1.0
    for edge in range(0, 9, 3):
        crossing = np.ceil(spans[edge] + spans[edge + 1] * row)  # beyond all integers where an edge is level
        is_left = spans[edge + 2] > 0.0
        left, right = larger(left, crossing if is_left else left), smaller(right, right if is_left else crossing)
    return left, right


@device_function(forceinline=True, divides_by_zero=True)
def inverse_distance(edges: Float64, x: float, y: float, z: float) -> float:
    """Return the inverse of the distance at which a ray meets a triangle, in lengths of its direction; or -1."""
    if (
        edges[0] * x + edges[1] * y + edges[2] * z >= 0.0
        and edges[3] * x + edges[4] * y + edges[5] * z >= 0.0
        and edges[6] * x + edges[7] * y + edges[8] * z >= 0.0
    ):
        return float(edges[9] * x + edges[10] * y + edges[11] * z)
    return -1.0


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _cover(triangle: int, first: int, end: int, inverse: float, step: float, near: Float32, seen: Int32) -> None:
    """Cover pixels of a row where a triangle is nearest; ``inverse`` is its inverse depth at the first one."""
    number = np.int32(triangle)
    for block in range(first, end, SHORT):
        first_here = inverse + step * single(block - first)
        for k in range(smaller(end - block, SHORT)):
            here, before = first_here + step * single_of(k), near[block + k]
            seen[block + k] = number if here > before else seen[block + k]
            near[block + k] = larger(before, here)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def write_spans(
    first: RayFunction, second: RayFunction, third: RayFunction, inverse: RayFunction, lens: Float64, spans: Float64
) -> None:
    """Write where the edges of a triangle cross the rows of a pinhole's picture, and its inverse depth there."""
    per_x, per_y = 1.0 / lens[at.FX], 1.0 / lens[at.FY]
    top = (0.5 - lens[at.CY]) * per_y
    _write_edge(first, 0, top, per_y, lens, spans)
    _write_edge(second, 3, top, per_y, lens, spans)
    _write_edge(third, 6, top, per_y, lens, spans)
    spans[10], spans[11] = inverse[0] * per_x, inverse[1] * per_y
    spans[9] = spans[10] * (0.5 - lens[at.CX]) + inverse[1] * top + inverse[2]


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _write_edge(edge: RayFunction, place: int, top: float, per_y: float, lens: Float64, spans: Float64) -> None:
    slope = edge[0] if abs(edge[0]) > 1e-30 else 1e-30
    scale = -lens[at.FX] / slope
    spans[place] = (edge[1] * top + edge[2]) * scale + lens[at.CX] - 0.5
    spans[place + 1] = edge[1] * per_y * scale
    spans[place + 2] = 1.0 if slope > 0.0 else 0.0


@device_function(divides_by_zero=True)
def _test(
    triangle: int, row: int, start: int, view: FrameView, edges: Float64, bounds: Int32, near: Float32, seen: Int32
) -> None:
    """Cover the pixels of a row whose rays hit a triangle, for any lens."""
    rays, width = view.rays, view.width
    most = 1 if view.lens[at.KIND] == codes.RINGS else 0
    for turn in range(-most, most + 1):  # columns beyond the picture are those of its other side
        first, end = larger(bounds[0] + turn * width, 0), smaller(bounds[2] + turn * width, width)
        for column in range(first, end):
            inverse = single(inverse_distance(edges, rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]))
            if inverse > near[start + column]:
                near[start + column] = inverse
                seen[start + column] = triangle
