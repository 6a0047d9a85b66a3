"""Pedestrians and cyclists, in a unit box that faces x; what moves has the numbers of ``Meshes.joints``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.shapes import Shape, ball, box, from_quads, loft, outward, tube

_LEFT_LEG, _RIGHT_ARM, _RIGHT_LEG, _LEFT_ARM = range(5, 9)


def person() -> list[Shape]:
    """Return a person who walks."""
    shapes = [
        tube((0.0, 0.0, 0.45), (0.0, 0.0, 0.68), ((0.24, 0.36), (0.23, 0.38)), at.BODY, 12),
        tube((0.0, 0.0, 0.68), (0.0, 0.0, 0.83), ((0.23, 0.38), (0.12, 0.24)), at.BODY, 12),
        *_head((0.03, 0.0, 0.92), (0.19, 0.16, 0.07)),
    ]
    for side, leg, arm in ((1.0, _LEFT_LEG, _LEFT_ARM), (-1.0, _RIGHT_LEG, _RIGHT_ARM)):
        limbs = [
            tube((0.0, side * 0.16, 0.02), (0.0, side * 0.16, 0.27), ((0.11, 0.10), (0.14, 0.13)), at.TROUSERS, 10),
            tube((0.0, side * 0.16, 0.27), (0.0, side * 0.16, 0.50), ((0.14, 0.13), (0.18, 0.16)), at.TROUSERS, 10),
            box((-0.12, side * 0.16 - 0.1, 0.0), (0.28, side * 0.16 + 0.1, 0.045), at.TRIM, (0.9, 0.9)),
        ]
        shapes += [replace(shape, part=leg) for shape in limbs]
        limbs = [
            tube((0.03, side * 0.46, 0.48), (0.0, side * 0.37, 0.78), ((0.08, 0.075), (0.115, 0.11)), at.BODY, 8),
            ball((0.0, side * 0.36, 0.785), (0.12, 0.115, 0.035), at.BODY, 8, 3),
            ball((0.04, side * 0.46, 0.46), (0.08, 0.07, 0.03), at.SKIN, 7, 3),
        ]
        shapes += [replace(shape, part=arm) for shape in limbs]
    return shapes


def _head(middle: tuple[float, float, float], radii: tuple[float, float, float]) -> list[Shape]:
    """Return neck, face and hair."""
    (x, y, z), (rx, ry, rz) = middle, radii
    return [
        tube((x - 0.2 * rx, y, z - 1.5 * rz), (x, y, z), ((0.5 * rx, 0.5 * ry), (0.5 * rx, 0.5 * ry)), at.SKIN, 8),
        ball(middle, radii, at.SKIN, 14, 7),
        ball((x - 0.2 * rx, y, z + 0.2 * rz), (1.02 * rx, 1.06 * ry, 0.92 * rz), at.TRIM, 14, 6),
    ]


def cyclist() -> list[Shape]:
    """Return a person who rides a bicycle."""
    rider = [
        tube((-0.13, 0.0, 0.51), (0.06, 0.0, 0.80), ((0.075, 0.26), (0.07, 0.36)), at.BODY, 12),
        *_head((0.11, 0.0, 0.91), (0.065, 0.16, 0.07)),
    ]
    for side, leg in ((1.0, _LEFT_LEG), (-1.0, _RIGHT_LEG)):
        hip, knee, foot = (-0.13, side * 0.17, 0.54), (0.09, side * 0.2, 0.42), (0.0, side * 0.2, 0.15)
        shoulder, hand = (0.05, side * 0.36, 0.78), (0.19, side * 0.38, 0.59)
        limbs = [
            tube(knee, hip, ((0.04, 0.11), (0.06, 0.15)), at.TROUSERS, 8),
            tube(foot, knee, ((0.03, 0.09), (0.045, 0.11)), at.TROUSERS, 8),
            box((-0.03, side * 0.2 - 0.08, 0.12), (0.08, side * 0.2 + 0.08, 0.16), at.TRIM),
        ]
        rider += [replace(shape, part=leg) for shape in limbs]
        rider.append(tube(hand, shoulder, ((0.025, 0.06), (0.035, 0.09)), at.BODY, 8))
    bars = [
        ((-0.14, 0.47), (-0.05, 0.17)), ((-0.05, 0.17), (0.21, 0.50)), ((-0.13, 0.45), (0.21, 0.49)),
        ((0.19, 0.58), (0.31, 0.2)), ((-0.31, 0.2), (-0.05, 0.17)), ((-0.31, 0.2), (-0.13, 0.45)),
    ]  # fmt: skip
    frame = [tube((x, 0.0, z), (u, 0.0, w), ((0.011, 0.04), (0.011, 0.04)), at.BODY, 6) for (x, z), (u, w) in bars]
    frame += [
        box((0.17, -0.42, 0.57), (0.20, 0.42, 0.59), at.TRIM), box((-0.20, -0.12, 0.47), (-0.08, 0.12, 0.50), at.TRIM),
    ]  # fmt: skip
    wheels = [shape for part, x in ((1, 0.31), (3, -0.31)) for shape in _bicycle_wheel(x, part)]
    return [*rider, *frame, *wheels]


def _bicycle_wheel(x: float, part: int) -> list[Shape]:
    """Return a tyre and spokes, seen from both sides."""
    angles = np.arange(21) * 2.0 * np.pi / 20
    tyre = [
        [(x + 0.185 * r * np.sin(a), y, 0.2 + 0.2 * r * np.cos(a)) for r, y in
         ((1.0, 0.0), (0.93, 0.045), (0.86, 0.0), (0.93, -0.045))] for a in angles.tolist()
    ]  # fmt: skip
    spokes = []
    for a in angles[:20:2].tolist():
        u, w = np.sin(a), np.cos(a)
        root, end = np.array([x, 0.0, 0.2]), np.array([x + 0.165 * u, 0.0, 0.2 + 0.178 * w])
        wide = 0.02 * np.array([w * 0.55, 0.0, -u * 0.6])
        spokes.append(from_quads([root - wide, end, end + 0.3 * wide, root + wide], [(0, 1, 2, 3), (3, 2, 1, 0)],
                                 [at.METAL, at.METAL]))  # fmt: skip
    return [replace(shape, part=part) for shape in (outward(loft(tyre, at.TYRE)), *spokes)]


def far_person() -> list[Shape]:
    """Return a person from far away."""
    legs = [
        box((-0.15, s * 0.16 - 0.13, 0.0), (0.15, s * 0.16 + 0.13, 0.49), at.TROUSERS, (1.0, 1.1)) for s in (1.0, -1.0)
    ]
    return [
        *(replace(leg, part=part) for leg, part in zip(legs, (_LEFT_LEG, _RIGHT_LEG), strict=True)),
        box((-0.2, -0.42, 0.47), (0.2, 0.42, 0.83), at.BODY, (0.8, 0.8)),
        box((-0.17, -0.15, 0.85), (0.17, 0.15, 1.0), at.SKIN),
    ]  # fmt: skip
