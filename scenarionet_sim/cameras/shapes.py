"""Building blocks of meshes: vertices and triangles with materials, in the unit box of ``Meshes``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64, Int32, UInt8


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles before their normals are known.

    Attributes:
        points: (V, 3).
        corners: (T, 3) int32 vertices, counter-clockwise from outside.
        material: (T,) uint8.
        part: 0, or 1 + the number of the wheel.
    """

    points: Float64
    corners: Int32
    material: UInt8
    part: int = 0


def box(low: Sequence[float], high: Sequence[float], material: int, taper: tuple[float, float] = (1.0, 1.0)) -> Shape:
    """Return a box between two corners, its top shrunk in x and y by ``taper`` around its middle."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    cx, cy, hx, hy = (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2
    bottom = [(cx - hx, cy - hy, z0), (cx + hx, cy - hy, z0), (cx + hx, cy + hy, z0), (cx - hx, cy + hy, z0)]
    hx, hy = hx * taper[0], hy * taper[1]
    top = [(cx - hx, cy - hy, z1), (cx + hx, cy - hy, z1), (cx + hx, cy + hy, z1), (cx - hx, cy + hy, z1)]
    quads = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return from_quads(bottom + top, quads, [material] * 6)


def without_bottom(shape: Shape) -> Shape:
    """Return a shape without its triangles that lie on the level of its lowest point."""
    is_bottom = (shape.points[shape.corners, 2] == shape.points[:, 2].min()).all(axis=1)
    return Shape(shape.points, shape.corners[~is_bottom], shape.material[~is_bottom], shape.part)


def from_quads(points: npt.ArrayLike, quads: Sequence[Sequence[int]], materials: Sequence[int], part: int = 0) -> Shape:
    """Return a shape of convex quads, each split along its diagonal."""
    four = np.asarray(quads, np.int32).reshape(-1, 4)
    corners = np.concatenate([four[:, [0, 1, 2]], four[:, [0, 2, 3]]])
    return Shape(np.asarray(points, np.float64), corners, np.tile(np.asarray(materials, np.uint8), 2), part)


def loft(rings: npt.ArrayLike, materials: npt.ArrayLike, caps: tuple[int | None, int | None] = (None, None)) -> Shape:
    """Return the surface through closed rings of points.

    Args:
        rings: (R, K, 3), each counter-clockwise seen from the side of the last ring.
        materials: (R - 1, K) material of each quad, from ring r to r + 1, from point k to k + 1, or one for all.
        caps: Materials of the flat ends, None for open ones.
    """
    points = np.asarray(rings, np.float64)
    count, sides = points.shape[:2]
    material = np.broadcast_to(np.asarray(materials), (count - 1, sides))
    quads, kinds = [], []
    for r in range(count - 1):
        for k in range(sides):
            after = (k + 1) % sides
            quads.append((r * sides + k, r * sides + after, (r + 1) * sides + after, (r + 1) * sides + k))
            kinds.append(int(material[r, k]))
    body = from_quads(points.reshape(-1, 3), quads, kinds)
    fans, fan_kinds = [], []
    for ring, cap in ((0, caps[0]), (count - 1, caps[1])):
        if cap is not None:
            for k in range(1, sides - 1):
                fan = (ring * sides, ring * sides + k, ring * sides + k + 1)
                fans.append(fan if ring else fan[::-1])
                fan_kinds.append(cap)
    corners = np.concatenate([body.corners, np.asarray(fans, np.int32).reshape(-1, 3)])
    return Shape(body.points, corners, np.concatenate([body.material, np.asarray(fan_kinds, np.uint8)]))


def tube(
    start: Sequence[float], end: Sequence[float], radii: tuple[tuple[float, float], tuple[float, float]], material: int,
    sides: int = 8,
) -> Shape:  # fmt: skip
    """Return a straight tube with closed ends.

    Args:
        start, end: Middle of its ends.
        radii: Radii of the start and of the end, each in x and y (for a tube along y: in x and z).
        material: Material.
        sides: Number of sides.
    """
    angles = np.arange(sides) * 2.0 * np.pi / sides
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    is_flat = abs(last[2] - first[2]) < max(abs(last[1] - first[1]), abs(last[0] - first[0]))
    rings = []
    for middle, (rx, ry) in ((first, radii[0]), (last, radii[1])):
        u, v, zero = rx * np.cos(angles), ry * np.sin(angles), np.zeros(sides)
        if not is_flat:
            around = np.stack([u, v, zero], axis=1)
        elif abs(last[1] - first[1]) >= abs(last[0] - first[0]):
            around = np.stack([u, zero, v], axis=1)
        else:
            around = np.stack([zero, u, v], axis=1)
        rings.append(middle + around)
    return outward(loft(rings, material, (material, material)))


def outward(shape: Shape) -> Shape:
    """Return a closed shape with its triangles counter-clockwise from outside."""
    a, b, c = (shape.points[shape.corners[:, k]] for k in range(3))
    is_outward = np.sum(a * np.cross(b, c)) > 0
    return shape if is_outward else Shape(shape.points, shape.corners[:, ::-1].copy(), shape.material, shape.part)


def ball(middle: Sequence[float], radii: Sequence[float], material: int, sides: int = 8, rows: int = 4) -> Shape:
    """Return an ellipsoid."""
    angles = np.arange(sides) * 2.0 * np.pi / sides
    rings = []
    for rise in np.linspace(-np.pi / 2, np.pi / 2, rows + 2)[1:-1] if rows > 1 else (-0.6, 0.6):
        rings.append(np.stack(
            [np.cos(rise) * np.cos(angles), np.cos(rise) * np.sin(angles), np.full(sides, np.sin(rise))], axis=1
        ))  # fmt: skip
    body = loft(np.array(rings), material, (material, material))
    return Shape(body.points * np.asarray(radii) + np.asarray(middle), body.corners, body.material)


def joined(shapes: Sequence[Shape]) -> tuple[Float64, Int32, UInt8, UInt8]:
    """Return points, corners, materials of the triangles and parts of the points of several shapes."""
    starts = np.cumsum([0] + [len(shape.points) for shape in shapes])
    points = np.concatenate([shape.points for shape in shapes])
    corners = np.concatenate([shape.corners + start for shape, start in zip(shapes, starts[:-1], strict=True)])
    material = np.concatenate([shape.material for shape in shapes])
    part = np.concatenate([np.full(len(shape.points), shape.part, np.uint8) for shape in shapes])
    return points, corners.astype(np.int32), material, part


def with_normals(
    points: Float64, corners: Int32, part: UInt8, scale: Sequence[float], crease: float
) -> tuple[Float64, Int32, UInt8]:
    """Split vertices so that each has one normal, the mean of the adjacent triangles within an angle.

    Args:
        points, corners, part: The mesh.
        scale: Typical length, width and height, in which angles are measured.
        crease: Angle [rad] beyond which an edge is sharp.

    Returns:
        Vertices (V, 6), corners (T, 3) and part (V,); normals are in the unit box's measures, ready to be divided by
        a size.
    """
    size = np.asarray(scale)
    a, b, c = (points[corners[:, k]] * size for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    unit = normal / np.maximum(area, 1e-12)
    kept = area[:, 0] > 1e-9
    corners, normal, unit = corners[kept], normal[kept], unit[kept]
    owners: dict[int, list[int]] = {}
    for t, triangle in enumerate(corners):
        for k in triangle:
            owners.setdefault(int(k), []).append(t)
    vertices: list[Float64] = []
    parts: list[int] = []
    seen: dict[tuple[int, tuple[float, ...]], int] = {}
    split = np.empty_like(corners)
    for t, triangle in enumerate(corners):
        for place, k in enumerate(triangle.tolist()):
            near = [o for o in owners[k] if unit[o] @ unit[t] > np.cos(crease)]
            mean = normal[near].sum(axis=0)
            mean = mean / max(float(np.linalg.norm(mean)), 1e-12)
            name = (k, tuple(np.round(mean, 4).tolist()))
            if name not in seen:
                seen[name] = len(vertices)
                vertices.append(np.concatenate([points[k], mean * size]))
                parts.append(int(part[k]))
            split[t, place] = seen[name]
    return np.array(vertices), split, np.array(parts, np.uint8)
