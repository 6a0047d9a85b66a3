"""Pedestrians and cyclists, in a unit box that faces x."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.shapes import Shape, ball, box, tube


def person(height: float = 1.0, base: float = 0.0, lean: float = 0.0) -> list[Shape]:
    """Return a person who stands on ``base`` and leans forward by ``lean``."""

    def z(share: float) -> float:
        return base + share * height

    legs = [
        tube((x, s * 0.17, z(0.0)), (0.0, s * 0.16, z(0.49)), ((0.13, 0.13), (0.17, 0.16)), at.TROUSERS, 7)
        for s, x in ((1.0, 0.16), (-1.0, -0.16))
    ]
    shoes = [
        box((x - 0.12, s * 0.17 - 0.1, z(0.0)), (x + 0.24, s * 0.17 + 0.1, z(0.04)), at.TRIM)
        for s, x in ((1.0, 0.16), (-1.0, -0.16))
    ]
    torso = [
        tube((0.0, 0.0, z(0.47)), (lean * 0.7, 0.0, z(0.70)), ((0.19, 0.30), (0.23, 0.38)), at.BODY, 10),
        tube((lean * 0.7, 0.0, z(0.70)), (lean, 0.0, z(0.83)), ((0.23, 0.38), (0.13, 0.26)), at.BODY, 10),
    ]
    arms = [
        tube((lean + x, s * 0.44, z(0.46)), (lean, s * 0.37, z(0.80)), ((0.08, 0.08), (0.11, 0.10)), at.BODY, 6)
        for s, x in ((1.0, -0.12), (-1.0, 0.14))
    ]
    head = [
        ball((lean + 0.02, 0.0, z(0.925)), (0.185, 0.16, 0.072 * height), at.SKIN, 9, 5),
        ball((lean - 0.02, 0.0, z(0.945)), (0.195, 0.175, 0.060 * height), at.TRIM, 9, 4),
    ]
    return [*legs, *shoes, *torso, *arms, *head]


def _scaled(shapes: list[Shape], scale: tuple[float, float, float], by: tuple[float, float, float]) -> list[Shape]:
    return [Shape(s.points * scale + np.asarray(by), s.corners, s.material, s.part) for s in shapes]


def cyclist() -> list[Shape]:
    """Return a person on a bicycle."""
    rider = _scaled(person(0.62, 0.38), (0.33, 0.9, 1.0), (-0.06, 0.0, 0.0))
    frame = [
        tube((-0.28, 0.0, 0.2), (0.05, 0.0, 0.45), ((0.012, 0.05), (0.012, 0.05)), at.BODY, 5),
        tube((-0.08, 0.0, 0.16), (-0.13, 0.0, 0.47), ((0.012, 0.05), (0.012, 0.05)), at.BODY, 5),
        tube((0.29, 0.0, 0.2), (0.20, 0.0, 0.56), ((0.012, 0.05), (0.012, 0.05)), at.BODY, 5),
        tube((-0.12, 0.0, 0.43), (0.20, 0.0, 0.46), ((0.01, 0.04), (0.01, 0.04)), at.BODY, 5),
        box((0.18, -0.4, 0.55), (0.21, 0.4, 0.575), at.TRIM),
    ]
    wheels = []
    for number, x in enumerate((0.31, -0.31)):
        tyre = tube((x, 0.06, 0.2), (x, -0.06, 0.2), ((0.185, 0.2), (0.185, 0.2)), at.TYRE, 16)
        rim = tube((x, 0.07, 0.2), (x, -0.07, 0.2), ((0.15, 0.165), (0.15, 0.165)), at.METAL, 6)
        wheels += [Shape(part.points, part.corners, part.material, 1 + 2 * number) for part in (tyre, rim)]
    return [*rider, *frame, *wheels]


def far_person() -> list[Shape]:
    """Return a person from far away."""
    return [
        box((-0.15, -0.25, 0.0), (0.15, 0.25, 0.48), at.TROUSERS), box((-0.2, -0.4, 0.48), (0.2, 0.4, 0.83), at.CLOTH),
        box((-0.16, -0.16, 0.85), (0.16, 0.16, 1.0), at.SKIN),
    ]  # fmt: skip
