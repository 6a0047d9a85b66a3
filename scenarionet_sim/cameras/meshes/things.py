"""What stands beside the road: cones, barriers, lights, trees and buildings, in a unit box."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.cameras.shapes import Shape, ball, box, from_quads, tube
from scenarionet_sim.kernels.cameras import layout as at


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
    rng: np.random.Generator, middle: tuple[float, float, float], radii: tuple[float, float, float]
) -> Shape:
    whole = ball(middle, radii, at.BODY, 7, 4)
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


def conifer() -> list[Shape]:
    """Return a conifer."""
    trunk = tube((0.0, 0.0, 0.0), (0.0, 0.0, 0.25), ((0.05, 0.05), (0.05, 0.05)), at.BARK, 6)
    tiers = [
        tube((0.0, 0.0, low), (0.0, 0.0, high), ((wide, wide), (0.02, 0.02)), at.BODY, 9)
        for low, high, wide in ((0.14, 0.56, 0.46), (0.36, 0.78, 0.36), (0.58, 1.0, 0.25))
    ]
    return [trunk, *tiers]


def building() -> list[Shape]:
    """Return a building with a flat roof; its windows are drawn by the material."""
    points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0),
              (-0.5, -0.5, 0.97), (0.5, -0.5, 0.97), (0.5, 0.5, 0.97), (-0.5, 0.5, 0.97)]  # fmt: skip
    walls = from_quads(points, [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], [at.FACADE] * 4)
    return [walls, box((-0.505, -0.505, 0.97), (0.505, 0.505, 1.0), at.ROOF)]


def far_tree() -> list[Shape]:
    """Return a broad-leaved tree from far away."""
    return [
        box((-0.04, -0.04, 0.0), (0.04, 0.04, 0.5), at.BARK),
        ball((0.0, 0.0, 0.68), (0.45, 0.45, 0.32), at.BODY, 6, 3),
    ]


def far_conifer() -> list[Shape]:
    """Return a conifer from far away."""
    tiers = [
        tube((0.0, 0.0, low), (0.0, 0.0, high), ((wide, wide), (0.02, 0.02)), at.BODY, 6)
        for low, high, wide in ((0.14, 0.62, 0.46), (0.48, 1.0, 0.31))
    ]
    return [box((-0.04, -0.04, 0.0), (0.04, 0.04, 0.2), at.BARK), *tiers]


def open_box(material: int) -> Shape:
    """Return the unit box without its bottom."""
    whole = box((-0.5, -0.5, 0.0), (0.5, 0.5, 1.0), material)
    is_bottom = (whole.points[whole.corners, 2] == 0.0).all(axis=1)
    return Shape(whole.points, whole.corners[~is_bottom], whole.material[~is_bottom])
