"""What stands beside the road: cones, barriers, lights, trees and buildings, in a unit box."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.shapes import Shape, ball, box, from_quads, loft, tube, without_bottom


def cone() -> list[Shape]:
    """Return a traffic cone."""

    def piece(low: float, high: float, material: int) -> Shape:
        first, last = 0.40 * (1.0 - 0.9 * low), 0.40 * (1.0 - 0.9 * high)
        return tube((0.0, 0.0, low), (0.0, 0.0, high), ((first, first), (last, last)), material, 12)

    return [
        box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.05), at.ORANGE), piece(0.05, 0.38, at.ORANGE),
        piece(0.38, 0.56, at.REFLECTIVE), piece(0.56, 0.70, at.ORANGE), piece(0.70, 0.82, at.REFLECTIVE),
        piece(0.82, 1.0, at.ORANGE),
    ]  # fmt: skip


def barrier() -> list[Shape]:
    """Return a concrete barrier with stripes."""
    long = [
        box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.25), at.REFLECTIVE),
        box((-0.5, -0.5, 0.25), (0.5, 0.5, 0.45), at.REFLECTIVE, (1.0, 0.5)),
        box((-0.5, -0.25, 0.45), (0.5, 0.25, 1.0), at.REFLECTIVE, (1.0, 0.8)),
    ]  # fmt: skip
    stripes = [box((x, -0.27, 0.6), (x + 0.1, 0.27, 0.9), at.ORANGE, (1.0, 0.9)) for x in np.linspace(-0.47, 0.37, 5)]
    return [*long, *stripes]


def light_head() -> list[Shape]:
    """Return a traffic light that faces -x: its box is the housing."""
    parts = [box((-0.3, -0.5, 0.0), (0.5, 0.5, 1.0), at.HOUSING)]
    for z, material in ((0.83, at.LAMP_RED), (0.5, at.LAMP_YELLOW), (0.17, at.LAMP_GREEN)):
        parts.append(tube((-0.34, 0.0, z), (-0.28, 0.0, z), ((0.34, 0.125), (0.34, 0.125)), material, 10))
        parts.append(box((-0.5, -0.36, z + 0.125), (-0.3, 0.36, z + 0.145), at.HOUSING))
    return parts


def far_light_head() -> list[Shape]:
    """Return a traffic light that faces -x from far away."""
    parts = [box((-0.3, -0.5, 0.0), (0.5, 0.5, 1.0), at.HOUSING)]
    for z, material in ((0.83, at.LAMP_RED), (0.5, at.LAMP_YELLOW), (0.17, at.LAMP_GREEN)):
        low, high = z - 0.11, z + 0.11
        corners = [(-0.34, 0.3, low), (-0.34, -0.3, low), (-0.34, -0.3, high), (-0.34, 0.3, high)]
        parts.append(from_quads(corners, [(0, 1, 2, 3)], [material]))
    return parts


def _rough_ball(
    rng: np.random.Generator, middle: tuple[float, float, float], radii: tuple[float, float, float], sides: int = 7,
    rows: int = 4,
) -> Shape:  # fmt: skip
    whole = ball(middle, radii, at.BODY, sides, rows)
    rough = whole.points + (whole.points - np.asarray(middle)) * rng.uniform(-0.22, 0.16, (len(whole.points), 1))
    return Shape(rough, whole.corners, whole.material)


def tree() -> list[Shape]:
    """Return a broad-leaved tree."""
    rng = np.random.default_rng(3)
    crown = [
        _rough_ball(rng, (0.0, 0.0, 0.64), (0.42, 0.42, 0.27)),
        _rough_ball(rng, (0.18, 0.14, 0.74), (0.30, 0.30, 0.2)),
        _rough_ball(rng, (-0.2, 0.06, 0.78), (0.28, 0.3, 0.2)),
        _rough_ball(rng, (0.02, -0.2, 0.66), (0.34, 0.28, 0.22)),
    ]  # fmt: skip
    return [tube((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), ((0.045, 0.045), (0.03, 0.03)), at.BARK, 6), *crown]


_TIERS = (0.14, 0.56, 0.46), (0.36, 0.78, 0.36), (0.58, 1.0, 0.25)
"""Heights of the lower and the upper end, and radius, of a conifer's parts."""


def conifer() -> list[Shape]:
    """Return a conifer."""
    trunk = tube((0.0, 0.0, 0.0), (0.0, 0.0, 0.25), ((0.05, 0.05), (0.05, 0.05)), at.BARK, 6)
    tiers = [
        tube((0.0, 0.0, low), (0.0, 0.0, high), ((wide, wide), (0.02, 0.02)), at.BODY, 9) for low, high, wide in _TIERS
    ]
    return [trunk, *tiers]


def building() -> list[Shape]:
    """Return a building with a flat roof; its windows are drawn by the material."""
    points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0),
              (-0.5, -0.5, 0.97), (0.5, -0.5, 0.97), (0.5, 0.5, 0.97), (-0.5, 0.5, 0.97)]  # fmt: skip
    walls = from_quads(points, [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], [at.FACADE] * 4)
    return [walls, box((-0.505, -0.505, 0.97), (0.505, 0.505, 1.0), at.ROOF)]


def middle_tree() -> list[Shape]:
    """Return a broad-leaved tree of few triangles."""
    rng = np.random.default_rng(3)
    crown = [
        _rough_ball(rng, (0.03, -0.06, 0.66), (0.45, 0.42, 0.31), 7, 3),
        _rough_ball(rng, (-0.10, 0.14, 0.76), (0.38, 0.36, 0.25), 7, 3),
    ]
    return [_open_tube(0.0, 0.5, 0.045, 0.03, at.BARK, 4), *crown]


def middle_conifer() -> list[Shape]:
    """Return a conifer of few triangles."""
    tiers = [_open_tube(low, high, wide, 0.0, at.BODY, 7) for low, high, wide in _TIERS]
    return [_open_tube(0.0, 0.25, 0.05, 0.05, at.BARK, 4), *tiers]


def _open_tube(low: float, high: float, below: float, above: float, material: int, sides: int) -> Shape:
    """Return an upright tube without ends, by its heights and radii; a cone where the upper one is 0."""
    angles = np.arange(sides) * 2.0 * np.pi / sides
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    return loft([below * around + (0.0, 0.0, low), above * around + (0.0, 0.0, high)], material)


_FAR_CROWN = (0.45, 0.41, 0.44, 0.42, 0.46, 0.40, 0.44, 0.43)
"""Radii of the outline of a far tree's crown, which is not round."""


def far_tree() -> list[Shape]:
    """Return the side of a broad-leaved tree that faces -x."""
    angles = (np.arange(8) + 0.4) * np.pi / 4.0
    outline = [
        (0.0, radius * np.cos(angle), 0.68 + 0.74 * radius * np.sin(angle))
        for radius, angle in zip(_FAR_CROWN, angles.tolist(), strict=True)
    ]
    fan = [(0, (k + 1) % 8 + 1, k + 1) for k in range(8)]
    return [_front([(-0.2, 0.0, 0.70), *outline], fan, at.BODY), _strip(0.035, 0.42, at.BARK)]


def tiny_tree(sides: int) -> list[Shape]:
    """Return the side of a broad-leaved tree that faces -x, seen from very far away: an outline of some sides."""
    wide, tall = (0.42, 0.34) if sides > 4 else (0.50, 0.42)
    angles = np.arange(sides) * 2.0 * np.pi / sides
    outline = [(0.12 * np.sin(a), wide * np.cos(a), 0.66 + tall * np.sin(a)) for a in angles.tolist()]
    return [_front(outline, [(0, k + 1, k) for k in range(1, sides - 1)], at.BODY)]


def far_conifer() -> list[Shape]:
    """Return the side of a conifer that faces -x."""
    tiers = [
        _front([(-wide, 0.0, low), (0.0, wide, low), (0.0, -wide, low), (0.0, 0.0, high)],
               [(0, 3, 1), (0, 2, 3)], at.BODY)
        for low, high, wide in ((0.14, 0.60, 0.42), (0.44, 1.0, 0.29))
    ]  # fmt: skip
    return [*tiers, _strip(0.04, 0.16, at.BARK)]


def tiny_conifer() -> list[Shape]:
    """Return the side of a conifer that faces -x, seen from very far away."""
    return [_front([(-0.2, 0.38, 0.12), (-0.2, -0.38, 0.12), (0.2, 0.0, 1.0)], [(0, 1, 2)], at.BODY)]


def street_lamp() -> list[Shape]:
    """Return a street lamp with two arms across the road."""
    arm = box((-0.02, -0.4, 0.965), (0.02, 0.4, 0.98), at.METAL)
    heads = [box((-0.05, s * 0.43 - 0.09, 0.955), (0.05, s * 0.43 + 0.09, 0.985), at.HOUSING) for s in (1.0, -1.0)]
    lights = [box((-0.045, s * 0.43 - 0.08, 0.948), (0.045, s * 0.43 + 0.08, 0.955), at.HEADLAMP) for s in (1.0, -1.0)]
    return [_open_tube(0.0, 0.97, 0.035, 0.022, at.METAL, 6), arm, *heads, *lights]


def sign() -> list[Shape]:
    """Return a round traffic sign that faces -x."""
    angles = np.arange(16) * np.pi / 8.0
    fan = [(0, k, k + 1) for k in range(1, 15)]
    discs = [
        _front([(x, -r * np.cos(a), 0.87 + 0.24 * r * np.sin(a)) for a in way * angles], fan, material)
        for x, r, way, material in (
            (-0.20, 0.5, 1.0, at.BODY), (-0.24, 0.38, 1.0, at.REFLECTIVE), (-0.16, 0.5, -1.0, at.METAL)
        )
    ]  # fmt: skip
    return [_open_tube(0.0, 0.98, 0.1, 0.1, at.METAL, 6), *discs]


def far_pole(half: float) -> list[Shape]:
    """Return the side of a pole that faces -x."""
    return [_strip(half, 1.0, at.METAL)]


def _strip(half: float, high: float, material: int) -> Shape:
    """Return the side of something upright that faces -x."""
    edge = [(0.0, half, 0.0), (0.0, -half, 0.0), (0.0, -half, high), (0.0, half, high)]
    return _front(edge, [(0, 1, 2), (0, 2, 3)], material)


def _front(points: list[tuple[float, float, float]], corners: list[tuple[int, int, int]], material: int) -> Shape:
    """Return triangles that are counter-clockwise seen from -x."""
    return Shape(np.array(points), np.array(corners, np.int32), np.full(len(corners), material, np.uint8))


def open_box(material: int) -> Shape:
    """Return the unit box without its bottom."""
    return without_bottom(box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), material))
