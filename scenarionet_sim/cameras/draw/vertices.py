"""Vertices of meshes in view: scaled to a box, with wheels that roll, before the camera and on the screen."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger
from scenarionet_sim.cameras.draw.layout import (
    AWAY,
    COLUMN,
    CX,
    CY,
    DOWN,
    EYE,
    FORWARD,
    FX,
    FY,
    KIND,
    NORMAL,
    PINHOLE,
    RIGHT,
    RINGS,
    ROW,
    VERTEX_END,
    VERTEX_FIRST,
    VIEW,
    Meshes,
)
from scenarionet_sim.cameras.draw.lens import project
from scenarionet_sim.cameras.draw.singles import single

NEAREST = 0.05
"""Distance [m] below which corners are not projected: the bounds are those of the picture."""

STEEP = 1e6
"""Slope of rays that are vertical for a lidar."""


@device_function(divides_by_zero=True, in_lanes=True)
def place_vertices(
    meshes: Meshes, mesh: int, box: Float64, turn: tuple[float, float], spin: float, steer: float, pose: Float64,
    lens: Float64, vertices: Float64, lights: Float32,
) -> int:  # fmt: skip
    """Write the vertices of a mesh in view, and their normals as :func:`turn_normals` takes them; return their number.

    Args:
        meshes, mesh: The mesh.
        box: (7,) x, y, z, heading, length, width, height.
        turn: Cosine and sine of the heading.
        spin, steer: Of the wheels, see ``instances.wheels_of``.
        pose, lens: The camera.
        vertices, lights: See ``FrameMemory``.
    """
    first, source = int(meshes.ranges[mesh, VERTEX_FIRST]), meshes.vertices
    count = meshes.ranges[mesh, VERTEX_END] - first
    xs, ys, zs = vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2]
    right, down, ahead = vertices[VIEW], vertices[VIEW + 1], vertices[VIEW + 2]
    _scale(first, count, box, source[0], source[1], source[2], xs, ys, zs)
    _scale_normals(
        first, count, single(1.0 / box[4]), single(1.0 / box[5]), single(1.0 / box[6]), source[3], source[4],
        source[5], lights[NORMAL], lights[NORMAL + 1], lights[NORMAL + 2],
    )  # fmt: skip
    if meshes.wheels[mesh, 0, 4] > 0.0:
        for k in range(count):
            if meshes.part[first + k] > 0:
                _roll(meshes, mesh, int(meshes.part[first + k]), box, spin, steer, k, vertices, lights)
    _turn(
        count, turn, box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] - pose[EYE + 2], pose, xs, ys, zs, right, down,
        ahead,
    )  # fmt: skip
    if lens[KIND] == PINHOLE:
        _project(count, lens, right, down, ahead, vertices[COLUMN], vertices[ROW])
    else:
        for k in range(count):
            _project_vertex(lens, k, vertices)
    return int(count)


@device_function(divides_by_zero=True)
def place_vertex(
    meshes: Meshes, mesh: int, number: int, k: int, box: Float64, turn: tuple[float, float], spin: float, steer: float,
    pose: Float64, lens: Float64, vertices: Float64, lights: Float32,
) -> None:  # fmt: skip
    """Write vertex ``number`` of all meshes as vertex ``k`` in view, see :func:`place_vertices`."""
    source = meshes.vertices
    xs, ys, zs = vertices[AWAY], vertices[AWAY + 1], vertices[AWAY + 2]
    _scale_vertex(number, k, box, source[0], source[1], source[2], xs, ys, zs)
    _scale_normal(
        number, k, single(1.0 / box[4]), single(1.0 / box[5]), single(1.0 / box[6]), source[3], source[4], source[5],
        lights[NORMAL], lights[NORMAL + 1], lights[NORMAL + 2],
    )  # fmt: skip
    if meshes.part[number] > 0:
        _roll(meshes, mesh, int(meshes.part[number]), box, spin, steer, k, vertices, lights)
    _turn_vertex(
        k, turn, box[0] - pose[EYE], box[1] - pose[EYE + 1], box[2] - pose[EYE + 2], pose, xs, ys, zs, vertices[VIEW],
        vertices[VIEW + 1], vertices[VIEW + 2],
    )  # fmt: skip
    _project_vertex(lens, k, vertices)


@device_function(forceinline=True, divides_by_zero=True)
def _scale_vertex(
    number: int, k: int, box: Float64, from_x: Float32, from_y: Float32, from_z: Float32, xs: Float64, ys: Float64,
    zs: Float64,
) -> None:  # fmt: skip
    """Write a vertex scaled to the box."""
    xs[k], ys[k], zs[k] = from_x[number] * box[4], from_y[number] * box[5], from_z[number] * box[6]


@device_function(divides_by_zero=True, in_lanes=True)
def _scale(
    first: int, count: int, box: Float64, from_x: Float32, from_y: Float32, from_z: Float32, xs: Float64, ys: Float64,
    zs: Float64,
) -> None:  # fmt: skip
    for k in range(count):
        _scale_vertex(first + k, k, box, from_x, from_y, from_z, xs, ys, zs)


@device_function(forceinline=True, divides_by_zero=True)
def _scale_normal(
    number: int, k: int, per_x: float, per_y: float, per_z: float, from_x: Float32, from_y: Float32, from_z: Float32,
    nx: Float32, ny: Float32, nz: Float32,
) -> None:  # fmt: skip
    """Write the normal of a vertex scaled to the box, of any length."""
    nx[k], ny[k], nz[k] = from_x[number] * per_x, from_y[number] * per_y, from_z[number] * per_z


@device_function(divides_by_zero=True, in_lanes=True)
def _scale_normals(
    first: int, count: int, per_x: float, per_y: float, per_z: float, from_x: Float32, from_y: Float32,
    from_z: Float32, nx: Float32, ny: Float32, nz: Float32,
) -> None:  # fmt: skip
    for k in range(count):
        _scale_normal(first + k, k, per_x, per_y, per_z, from_x, from_y, from_z, nx, ny, nz)


@device_function(divides_by_zero=True, in_lanes=True)
def _roll(
    meshes: Meshes, mesh: int, part: int, box: Float64, spin: float, steer: float, k: int, vertices: Float64,
    lights: Float32,
) -> None:  # fmt: skip
    """Roll a vertex of a wheel about its axle, and steer it if it is on a front wheel."""
    wheel = meshes.wheels[mesh, part - 1]
    cx, cy, cz, radius = wheel[0] * box[4], wheel[1] * box[5], wheel[2] * box[6], wheel[4] * box[6]
    angle = spin / larger(radius, 0.05)
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = vertices[AWAY, k], vertices[AWAY + 1, k], vertices[AWAY + 2, k]
    nx, ny, nz = lights[NORMAL, k], lights[NORMAL + 1, k], lights[NORMAL + 2, k]
    dx, dz = (x - cx) / larger(box[4] * wheel[3], 1e-3), (z - cz) / larger(radius, 1e-3)
    x, z = cx + radius * (c * dx + s * dz), cz + radius * (c * dz - s * dx)
    nx, nz = c * nx + s * nz, c * nz - s * nx
    if part <= 2:
        c, s = math.cos(steer), math.sin(steer)
        dx, dy = x - cx, y - cy
        x, y = cx + c * dx - s * dy, cy + s * dx + c * dy
        nx, ny = c * nx - s * ny, s * nx + c * ny
    vertices[AWAY, k], vertices[AWAY + 1, k], vertices[AWAY + 2, k] = x, y, z
    lights[NORMAL, k], lights[NORMAL + 1, k], lights[NORMAL + 2, k] = nx, ny, nz


@device_function(forceinline=True, divides_by_zero=True)
def _turn_vertex(
    k: int, turn: tuple[float, float], x: float, y: float, z: float, pose: Float64, xs: Float64, ys: Float64,
    zs: Float64, right: Float64, down: Float64, ahead: Float64,
) -> None:  # fmt: skip
    """Turn a vertex into the scenario's frame, ``x``, ``y``, ``z`` from the camera, and into the camera's."""
    cos, sin = turn
    ax, ay, az = x + cos * xs[k] - sin * ys[k], y + sin * xs[k] + cos * ys[k], z + zs[k]
    xs[k], ys[k], zs[k] = ax, ay, az
    right[k] = pose[RIGHT] * ax + pose[RIGHT + 1] * ay + pose[RIGHT + 2] * az
    down[k] = pose[DOWN] * ax + pose[DOWN + 1] * ay + pose[DOWN + 2] * az
    ahead[k] = pose[FORWARD] * ax + pose[FORWARD + 1] * ay + pose[FORWARD + 2] * az


@device_function(divides_by_zero=True, in_lanes=True)
def _turn(
    count: int, turn: tuple[float, float], x: float, y: float, z: float, pose: Float64, xs: Float64, ys: Float64,
    zs: Float64, right: Float64, down: Float64, ahead: Float64,
) -> None:  # fmt: skip
    for k in range(count):
        _turn_vertex(k, turn, x, y, z, pose, xs, ys, zs, right, down, ahead)


@device_function(divides_by_zero=True, in_lanes=True)
def turn_normals(count: int, cos: float, sin: float, nx: Float32, ny: Float32, nz: Float32) -> None:
    """Turn normals into the scenario's frame, and make them unit vectors."""
    for k in range(count):
        u, v, w = nx[k], ny[k], nz[k]
        unit = 1.0 / math.sqrt(u * u + v * v + w * w + 1e-30)
        nx[k], ny[k], nz[k] = (cos * u - sin * v) * unit, (sin * u + cos * v) * unit, w * unit


@device_function(divides_by_zero=True)
def _project_vertex(lens: Float64, k: int, vertices: Float64) -> None:
    """Write column and row of a vertex in front of the camera; for a lidar, azimuth [rad] and slope of its ray."""
    right, down, ahead = vertices[VIEW, k], vertices[VIEW + 1, k], vertices[VIEW + 2, k]
    if lens[KIND] == RINGS:
        flat = math.sqrt(right * right + ahead * ahead)
        vertices[COLUMN, k], vertices[ROW, k] = math.atan2(-right, ahead), -down / flat if flat > NEAREST else STEEP
    elif lens[KIND] != PINHOLE or ahead >= NEAREST:
        place = project(lens, right, down, ahead)
        vertices[COLUMN, k], vertices[ROW, k] = place


@device_function(divides_by_zero=True, in_lanes=True)
def _project(
    count: int, lens: Float64, right: Float64, down: Float64, ahead: Float64, columns: Float64, rows: Float64
) -> None:
    """Write columns and rows of vertices in the picture of a pinhole, see :func:`_project_vertex`."""
    fx, fy, cx, cy = lens[FX], lens[FY], lens[CX], lens[CY]
    for k in range(count):
        per = 1.0 / ahead[k]
        columns[k], rows[k] = fx * (right[k] * per) + cx, fy * (down[k] * per) + cy
