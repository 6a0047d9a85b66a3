"""Triangles in view: their projection, and the nearest one along the ray of every pixel.

A ray with direction d (right, down, ahead) hits the triangle a, b, c at the weights d.(b x c), d.(c x a), d.(a x b) of
its corners, relative to their sum, if all are positive; the inverse of the distance is their sum over the volume
a.(b x c). This holds for every lens and needs no clipping; with a pinhole the functions are linear along a row.
(Olano, Greer: Triangle scan conversion using 2D homogeneous coordinates, 1997.)
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.kernels.cameras.layout import (
    BOTTOM,
    CX,
    CY,
    FX,
    FY,
    KIND,
    PINHOLE,
    RINGS,
    TOP,
    TRI_END,
    TRI_FIRST,
    FrameMemory,
)
from scenarionet_sim.kernels.cameras.lens import project
from scenarionet_sim.kernels.minmax import larger, smaller

NEAREST = 0.05
"""Distance [m] below which corners are not projected: the bounds are those of the picture."""

WIDE = 0.35
"""Angle [rad] under which a triangle's edges are bent too much by a lens to be bounded by its corners."""


@device_function(divides_by_zero=True)
def bound_triangle(
    vertices: Float64, a: int, b: int, c: int, lens: Float64, rings: Float64, width: int, height: int, bounds: Int32
) -> None:
    """Write the screen bounds (4,) of a triangle."""
    kind = lens[KIND]
    bounds[0], bounds[1], bounds[2], bounds[3] = 0, 0, width, height
    if kind == RINGS:
        _bound_on_rings(vertices, a, b, c, rings, width, bounds)
        return
    if kind == PINHOLE:
        if smaller(vertices[a, 2], smaller(vertices[b, 2], vertices[c, 2])) < NEAREST:
            return
    elif _is_wide(vertices, a, b) or _is_wide(vertices, b, c) or _is_wide(vertices, c, a):
        return
    low_x = smaller(vertices[a, 9], smaller(vertices[b, 9], vertices[c, 9]))
    high_x = larger(vertices[a, 9], larger(vertices[b, 9], vertices[c, 9]))
    low_y = smaller(vertices[a, 10], smaller(vertices[b, 10], vertices[c, 10]))
    high_y = larger(vertices[a, 10], larger(vertices[b, 10], vertices[c, 10]))
    if kind == PINHOLE:  # rows and columns whose middle is inside
        bounds[0] = int(smaller(larger(math.ceil(low_x - 0.501), 0.0), width))
        bounds[1] = int(smaller(larger(math.ceil(low_y - 0.501), 0.0), height))
        bounds[2] = int(smaller(larger(math.floor(high_x + 0.501), 0.0), width))
        bounds[3] = int(smaller(larger(math.floor(high_y + 0.501), 0.0), height))
        return
    pad_x = pad_y = 1.0 + 0.1 * larger(high_x - low_x, high_y - low_y)
    bounds[0] = int(smaller(larger(math.floor(low_x - pad_x), 0.0), width))
    bounds[1] = int(smaller(larger(math.floor(low_y - pad_y), 0.0), height))
    bounds[2] = int(smaller(larger(math.ceil(high_x + pad_x), 0.0), width))
    bounds[3] = int(smaller(larger(math.ceil(high_y + pad_y), 0.0), height))


@device_function(divides_by_zero=True)
def _is_wide(vertices: Float64, a: int, b: int) -> bool:
    """Whether the camera sees two vertices more than ``WIDE`` apart, or one of them from closer than ``NEAREST``."""
    dot = vertices[a, 0] * vertices[b, 0] + vertices[a, 1] * vertices[b, 1] + vertices[a, 2] * vertices[b, 2]
    first = vertices[a, 0] ** 2 + vertices[a, 1] ** 2 + vertices[a, 2] ** 2
    second = vertices[b, 0] ** 2 + vertices[b, 1] ** 2 + vertices[b, 2] ** 2
    is_near = smaller(first, second) < NEAREST * NEAREST
    return bool(is_near or dot < math.cos(WIDE) * math.sqrt(first * second))


@device_function(divides_by_zero=True)
def _bound_on_rings(vertices: Float64, a: int, b: int, c: int, rings: Float64, width: int, bounds: Int32) -> None:
    """Bound a triangle on a lidar's rings (descending elevations); columns may exceed the picture on either side."""
    if _is_wide(vertices, a, b) or _is_wide(vertices, b, c) or _is_wide(vertices, c, a):
        return
    start = math.atan2(-vertices[a, 0], vertices[a, 2])
    low = high = 0.0
    down, up = math.pi, -math.pi
    for corner in (a, b, c):
        turn = math.atan2(-vertices[corner, 0], vertices[corner, 2]) - start
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        low, high = smaller(low, turn), larger(high, turn)
        rise = math.atan2(-vertices[corner, 1], math.hypot(vertices[corner, 0], vertices[corner, 2]))
        down, up = smaller(down, rise), larger(up, rise)
    if high - low > 1.0:
        return
    pad = 0.02 + 0.1 * (up - down + high - low)
    scale = width / (2.0 * math.pi)
    bounds[0] = math.floor((start + low - pad) * scale)
    bounds[2] = math.ceil((start + high + pad) * scale) + 1
    first, end = 0, len(rings)
    while first < end and rings[first] > up + pad:
        first += 1
    while end > first and rings[end - 1] < down - pad:
        end -= 1
    bounds[1], bounds[3] = first, end


@device_function(forceinline=True, divides_by_zero=True)
def add_triangle(
    vertices: Float64, a: int, b: int, c: int, lens: Float64, rings: Float64, width: int, height: int, edges: Float64,
    spans: Float64, bounds: Int32,
) -> bool:  # fmt: skip
    """Write edge functions (12,), spans (12,) and bounds (4,) of a triangle, if it may be in view."""
    ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    bx, by, bz = vertices[b, 0], vertices[b, 1], vertices[b, 2]
    cx, cy, cz = vertices[c, 0], vertices[c, 1], vertices[c, 2]
    ex, ey, ez = cy * bz - cz * by, cz * bx - cx * bz, cx * by - cy * bx  # -(b x c)
    volume = ax * ex + ay * ey + az * ez
    if volume <= 1e-12:
        return False
    bound_triangle(vertices, a, b, c, lens, rings, width, height, bounds)
    if bounds[0] >= bounds[2] or bounds[1] >= bounds[3]:
        return False
    fx, fy, fz = ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx  # -(c x a)
    gx, gy, gz = by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax  # -(a x b)
    edges[0], edges[1], edges[2] = ex, ey, ez
    edges[3], edges[4], edges[5] = fx, fy, fz
    edges[6], edges[7], edges[8] = gx, gy, gz
    edges[9], edges[10], edges[11] = (ex + fx + gx) / volume, (ey + fy + gy) / volume, (ez + fz + gz) / volume
    if lens[KIND] == PINHOLE:
        write_spans(edges, lens, spans)
    return True


@device_function(divides_by_zero=True)
def list_band(first: int, end: int, num_instances: int, instances: Int32, bounds: Int32, active: Int32) -> int:
    """List the triangles whose bounds touch a band of rows, in ``active``; return their number."""
    count = 0
    for place in range(num_instances):
        if instances[place, TOP] < end and instances[place, BOTTOM] > first:
            for triangle in range(instances[place, TRI_FIRST], instances[place, TRI_END]):
                if bounds[triangle, 1] < end and bounds[triangle, 3] > first:
                    active[count] = triangle
                    count += 1
    return count


@device_function(divides_by_zero=True)
def trace_row(row: int, num_active: int, lens: Float64, rays: Float64, width: int, scratch: FrameMemory) -> None:
    """Find the nearest of the listed triangles along the ray of every pixel of a row."""
    near, seen, bounds, active = scratch.near, scratch.seen, scratch.bounds, scratch.active
    for column in range(width):
        near[column] = 0.0
    for column in range(width):
        seen[column] = -1
    is_pinhole = lens[KIND] == PINHOLE
    for place in range(num_active):
        triangle = active[place]
        if bounds[triangle, 1] <= row < bounds[triangle, 3]:
            if is_pinhole:
                _scan(triangle, row, bounds, scratch.spans, near, seen)
            else:
                _test(triangle, row, lens, rays, width, scratch.edges, bounds, near, seen)


@device_function(forceinline=True, divides_by_zero=True)
def span_of(bounds: Int32, spans: Float64, row: int) -> tuple[float, float]:
    """Return the first column and the end of a triangle in a row of a pinhole's picture, from its bounds and spans."""
    left, right = bounds[0] * 1.0, bounds[2] * 1.0
    for edge in range(0, 9, 3):
        crossing = math.ceil(spans[edge] + spans[edge + 1] * row)
        if spans[edge + 2] > 0.0:
            left = larger(left, crossing)
        else:
            right = smaller(right, crossing)
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


@device_function(forceinline=True, divides_by_zero=True)
def _scan(triangle: int, row: int, bounds: Int32, spans: Float64, near: Float64, seen: Int32) -> None:
    """Cover the span of a triangle in a row of a pinhole's picture."""
    left, right = span_of(bounds[triangle], spans[triangle], row)
    if left >= right:
        return
    step = spans[triangle, 10] + 0.0
    start = spans[triangle, 9] + spans[triangle, 11] * row + step * left
    near, seen = near[int(left) : int(right)], seen[int(left) : int(right)]
    # One output per loop, and no load behind a condition: the compiler then computes several pixels at once.
    for k in range(len(near)):
        before = seen[k]
        seen[k] = np.int32(triangle) if start + step * k > near[k] else before
    for k in range(len(near)):
        near[k] = larger(near[k], start + step * k)


@device_function(divides_by_zero=True)
def write_spans(edges: Float64, lens: Float64, spans: Float64) -> None:
    """Write where the edges of a triangle cross the rows of a pinhole's picture, and its inverse depth there."""
    per_x, per_y = 1.0 / lens[FX], 1.0 / lens[FY]
    top = (0.5 - lens[CY]) * per_y
    for edge in range(0, 9, 3):
        slope = edges[edge] if abs(edges[edge]) > 1e-30 else 1e-30
        scale = -lens[FX] / slope
        spans[edge] = (edges[edge + 1] * top + edges[edge + 2]) * scale + lens[CX] - 0.5
        spans[edge + 1] = edges[edge + 1] * per_y * scale
        spans[edge + 2] = 1.0 if slope > 0.0 else 0.0
    spans[10], spans[11] = edges[9] * per_x, edges[10] * per_y
    spans[9] = spans[10] * (0.5 - lens[CX]) + edges[10] * top + edges[11]


@device_function(divides_by_zero=True)
def _test(
    triangle: int, row: int, lens: Float64, rays: Float64, width: int, all_edges: Float64, bounds: Int32, near: Float64,
    seen: Int32,
) -> None:  # fmt: skip
    """Cover the pixels of a row whose rays hit a triangle, for any lens."""
    edges = all_edges[triangle]
    for place in range(bounds[triangle, 0], bounds[triangle, 2]):
        column = place
        if lens[KIND] == RINGS:
            column = place % width
        inverse = inverse_distance(edges, rays[row, column, 0], rays[row, column, 1], rays[row, column, 2])
        if inverse > near[column]:
            near[column] = inverse
            seen[column] = triangle


@device_function(divides_by_zero=True)
def project_vertex(lens: Float64, vertex: Float64) -> None:
    """Write column and row of a vertex in front of the camera behind its position and normal."""
    if lens[KIND] != RINGS and (lens[KIND] != PINHOLE or vertex[2] >= NEAREST):
        vertex[9], vertex[10] = project(lens, vertex[0], vertex[1], vertex[2])
