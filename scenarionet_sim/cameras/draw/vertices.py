"""Vertices of meshes in view: scaled to a box, with wheels that roll, before the camera and on the screen."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float32, Float64, UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.minmax import larger
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.lens import project
from scenarionet_sim.cameras.draw.single_precision import single
from scenarionet_sim.cameras.draw.structures import FrameView, Item, Meshes, Places, Triple

NEAREST = 0.05
"""Distance [m] below which corners are not projected: the bounds are those of the picture."""

LIMBS = 4
"""First joint of limbs; those before are of wheels."""

STEEP = 1e6
"""Slope of rays that are vertical for a lidar."""


@device_function(divides_by_zero=True, in_lanes=True)
def place_vertices(
    first: int, count: int, item: Item, view: FrameView, meshes: Meshes, vertices: Float64, lights: Float32
) -> None:
    """Write vertices of a mesh in view, and their normals as :func:`turn_normals` takes them.

    Args:
        first, count: Vertices of all meshes, which belong to that of the item.
        item, view, meshes: See ``structures``.
        vertices, lights: See ``Vertices``.
    """
    source, box, pose = meshes.vertices, item.box, view.pose
    away = vertices[at.AWAY], vertices[at.AWAY + 1], vertices[at.AWAY + 2]
    before = vertices[at.VIEW], vertices[at.VIEW + 1], vertices[at.VIEW + 2]
    normals = lights[at.NORMAL], lights[at.NORMAL + 1], lights[at.NORMAL + 2]
    per = single(1.0 / box[4]), single(1.0 / box[5]), single(1.0 / box[6])
    _scale(first, count, box, (source[0], source[1], source[2]), away)
    _scale_normals(first, count, per, (source[3], source[4], source[5]), normals)
    joints, sink = meshes.joints[item.mesh], 0.0
    if joints[0, 2] >= 0.0 or joints[LIMBS, 2] >= 0.0:
        _move_parts(first, count, item, joints, meshes.part, vertices, lights)
    if joints[0, 2] < 0.0 <= joints[LIMBS, 2]:  # legs apart are less high
        sink = joints[LIMBS, 2] * box[6] * (1.0 - math.cos(item.moves[2]))
    start = box[0] - pose[at.EYE], box[1] - pose[at.EYE + 1], box[2] - pose[at.EYE + 2] - sink
    _turn(count, item.turn, start, pose, away, before)
    if view.lens[at.KIND] == codes.PINHOLE:
        _project(count, view.lens, before, vertices[at.COLUMN], vertices[at.ROW])
    else:
        for k in range(count):
            _project_vertex(view.lens, k, vertices)


@device_function(divides_by_zero=True, in_lanes=True)
def _scale(first: int, count: int, box: Float64, source: Triple, away: Places) -> None:
    """Write vertices scaled to the box."""
    from_x, from_y, from_z = source
    xs, ys, zs = away
    for k in range(count):
        xs[k], ys[k], zs[k] = from_x[first + k] * box[4], from_y[first + k] * box[5], from_z[first + k] * box[6]


@device_function(divides_by_zero=True, in_lanes=True)
def _scale_normals(first: int, count: int, per: tuple[float, float, float], source: Triple, normals: Triple) -> None:
    """Write the normals of vertices scaled to the box, of any length."""
    from_x, from_y, from_z = source
    nx, ny, nz = normals
    for k in range(count):
        nx[k], ny[k], nz[k] = from_x[first + k] * per[0], from_y[first + k] * per[1], from_z[first + k] * per[2]


@device_function(divides_by_zero=True)
def _move_parts(
    first: int, count: int, item: Item, joints: Float32, parts: UInt8, vertices: Float64, lights: Float32
) -> None:
    """Roll and steer wheels, which are round, and swing limbs."""
    box, before, turn, stretch = item.box, 0, (1.0, 0.0), 1.0
    for k in range(count):
        part = int(parts[first + k])
        if part == 0:
            continue
        joint = joints[part - 1]
        if part != before:
            radius = joint[4] * box[6]
            angle = item.moves[0] / larger(radius, 0.05)
            if part > LIMBS:
                angle = item.moves[2] if part <= LIMBS + 2 else -item.moves[2]
            turn = math.cos(angle), math.sin(angle)
            stretch, before = radius / larger(box[4] * joint[3], 1e-3), part
        _turn_part(joint, stretch, turn, part <= 2, item, k, vertices, lights)


@device_function(divides_by_zero=True)
def _turn_part(
    joint: Float32, stretch: float, turn: tuple[float, float], is_front: bool, item: Item, k: int, vertices: Float64,
    lights: Float32,
) -> None:  # fmt: skip
    """Turn a vertex about the axle of its part, and steer it if it is on a front wheel."""
    box, (c, s) = item.box, turn
    cx, cy, cz = joint[0] * box[4], joint[1] * box[5], joint[2] * box[6]
    x, y, z = vertices[at.AWAY, k], vertices[at.AWAY + 1, k], vertices[at.AWAY + 2, k]
    nx, ny, nz = lights[at.NORMAL, k], lights[at.NORMAL + 1, k], lights[at.NORMAL + 2, k]
    dx, dz = (x - cx) * stretch, z - cz
    x, z = cx + (c * dx + s * dz), cz + (c * dz - s * dx)
    nx, nz = c * nx + s * nz, c * nz - s * nx
    if is_front:
        c, s = math.cos(item.moves[1]), math.sin(item.moves[1])
        dx, dy = x - cx, y - cy
        x, y = cx + c * dx - s * dy, cy + s * dx + c * dy
        nx, ny = c * nx - s * ny, s * nx + c * ny
    vertices[at.AWAY, k], vertices[at.AWAY + 1, k], vertices[at.AWAY + 2, k] = x, y, z
    lights[at.NORMAL, k], lights[at.NORMAL + 1, k], lights[at.NORMAL + 2, k] = nx, ny, nz


@device_function(divides_by_zero=True, in_lanes=True)
def _turn(
    count: int, turn: tuple[float, float], start: tuple[float, float, float], pose: Float64, away: Places,
    before: Places,
) -> None:  # fmt: skip
    """Turn vertices into the scenario's frame, of a mesh that is at ``start`` from the camera, and the camera's."""
    cos, sin = turn
    x, y, z = start
    xs, ys, zs = away
    right, down, ahead = before
    for k in range(count):
        ax, ay, az = x + cos * xs[k] - sin * ys[k], y + sin * xs[k] + cos * ys[k], z + zs[k]
        xs[k], ys[k], zs[k] = ax, ay, az
        right[k] = pose[at.RIGHT] * ax + pose[at.RIGHT + 1] * ay + pose[at.RIGHT + 2] * az
        down[k] = pose[at.DOWN] * ax + pose[at.DOWN + 1] * ay + pose[at.DOWN + 2] * az
        ahead[k] = pose[at.FORWARD] * ax + pose[at.FORWARD + 1] * ay + pose[at.FORWARD + 2] * az


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
    right, down, ahead = vertices[at.VIEW, k], vertices[at.VIEW + 1, k], vertices[at.VIEW + 2, k]
    if lens[at.KIND] == codes.RINGS:
        flat = math.sqrt(right * right + ahead * ahead)
        vertices[at.COLUMN, k], vertices[at.ROW, k] = (
            math.atan2(-right, ahead),
            -down / flat if flat > NEAREST else STEEP,
        )
    elif lens[at.KIND] != codes.PINHOLE or ahead >= NEAREST:
        place = project(lens, right, down, ahead)
        vertices[at.COLUMN, k], vertices[at.ROW, k] = place


@device_function(divides_by_zero=True, in_lanes=True)
def _project(count: int, lens: Float64, before: Places, columns: Float64, rows: Float64) -> None:
    """Write columns and rows of vertices in the picture of a pinhole, see :func:`_project_vertex`."""
    fx, fy, cx, cy = lens[at.FX], lens[at.FY], lens[at.CX], lens[at.CY]
    right, down, ahead = before
    for k in range(count):
        per = 1.0 / ahead[k]
        columns[k], rows[k] = fx * (right[k] * per) + cx, fy * (down[k] * per) + cy
