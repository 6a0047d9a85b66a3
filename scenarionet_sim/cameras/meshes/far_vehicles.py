"""Cars, vans, trucks and buses of few triangles, for pictures in which they are small, in a unit box."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.meshes.vehicles import hull
from scenarionet_sim.cameras.shapes import Shape, box, from_quads, without_bottom


def middle_car() -> list[Shape]:
    """Return a car of few triangles."""
    body = hull([
        (-0.50, 0.42, 0.38, 0.22, 0.54, 0.56), (-0.40, 0.485, 0.40, 0.14, 0.635, 0.66),
        (-0.245, 0.49, 0.375, 0.12, 0.635, 0.965), (-0.05, 0.49, 0.38, 0.12, 0.63, 1.0),
        (0.05, 0.49, 0.375, 0.12, 0.625, 0.985), (0.215, 0.49, 0.42, 0.12, 0.605, 0.645),
        (0.44, 0.46, 0.40, 0.15, 0.51, 0.53), (0.50, 0.39, 0.33, 0.22, 0.42, 0.44),
    ], is_coarse=True)  # fmt: skip
    lamps = [_lamp(-0.503, s * 0.335, 0.215, 0.44, 0.545) for s in (1.0, -1.0)]
    lamps += [_lamp(0.498, s * 0.32, 0.18, 0.34, 0.435) for s in (1.0, -1.0)]
    details = [_plate(0.42, 0.17, 0.27, at.TRIM), _plate(0.14, 0.36, 0.44, at.REFLECTIVE)]
    return [body, *lamps, *details, *_axles((0.30, -0.29)), *_discs((0.30, -0.29), 0.325, 4.6, 1.55)]


def middle_van() -> list[Shape]:
    """Return a van of few triangles."""
    body = hull([
        (-0.50, 0.46, 0.42, 0.14, 0.52, 0.92), (-0.48, 0.485, 0.44, 0.12, 0.53, 0.985),
        (0.03, 0.49, 0.45, 0.10, 0.53, 1.0), (0.20, 0.49, 0.44, 0.10, 0.53, 0.95),
        (0.36, 0.48, 0.43, 0.11, 0.52, 0.56), (0.50, 0.42, 0.36, 0.17, 0.38, 0.40),
    ], is_coarse=True)  # fmt: skip
    lamps = [_lamp(-0.503, s * 0.44, 0.06, 0.42, 0.62) for s in (1.0, -1.0)]
    lamps += [_lamp(0.5, s * 0.34, 0.18, 0.31, 0.39) for s in (1.0, -1.0)]
    plate = _plate(0.12, 0.30, 0.37, at.REFLECTIVE)
    return [body, *lamps, plate, *_axles((0.31, -0.30)), *_discs((0.31, -0.30), 0.34, 5.4, 2.0)]


def _lamp(x: float, y: float, width: float, low: float, high: float) -> Shape:
    """Return a flat lamp at the rear or at the front."""
    side = 0.5 * width if x < 0.0 else -0.5 * width
    corners = [(x, y + side, low), (x, y - side, low), (x, y - side, high), (x, y + side, high)]
    return from_quads(corners, [(0, 1, 2, 3)], [at.TAIL_LAMP if x < 0.0 else at.HEADLAMP])


def _plate(half: float, low: float, high: float, material: int) -> Shape:
    """Return a flat part of the rear."""
    corners = [(-0.507, half, low), (-0.507, -half, low), (-0.507, -half, high), (-0.507, half, high)]
    return from_quads(corners, [(0, 1, 2, 3)], [material])


def _axles(places: tuple[float, ...]) -> list[Shape]:
    """Return what is seen of wheels from ahead and behind."""
    return [without_bottom(box((x - 0.07, -0.485, 0.0), (x + 0.07, 0.485, 0.3), at.TYRE)) for x in places]


def _discs(axles: tuple[float, ...], radius: float, length: float, height: float) -> list[Shape]:
    """Return the outer sides of wheels, which do not roll."""
    shapes = []
    for share, sides, out, material in ((1.0, 12, 0.495, at.TYRE), (0.62, 9, 0.5, at.METAL)):
        angles = np.arange(sides) * 2.0 * np.pi / sides
        fan = np.array([(0, k, k + 1) for k in range(1, sides - 1)], np.int32)
        for x in axles:
            for side in (1.0, -1.0):
                around = x + side * share * radius / length * np.sin(angles)
                points = np.stack(
                    [around, np.full(sides, side * out), radius / height * (1.0 + share * np.cos(angles))], axis=1
                )
                shapes.append(Shape(points, fan, np.full(len(fan), material, np.uint8)))
    return shapes


def far_car() -> list[Shape]:
    """Return a car from far away."""
    roof = [(-0.245, -0.37, 1.0), (0.08, -0.37, 1.0), (0.08, 0.37, 1.0), (-0.245, 0.37, 1.0)]
    return [
        box((-0.5, -0.48, 0.14), (0.5, 0.48, 0.62), at.BODY, (0.97, 0.95)),
        without_bottom(box((-0.40, -0.44, 0.62), (0.24, 0.44, 0.995), at.GLASS, (0.62, 0.85))),
        from_quads(roof, [(0, 1, 2, 3)], [at.BODY]),
        _lamp(-0.505, 0.33, 0.22, 0.42, 0.54), _lamp(-0.505, -0.33, 0.22, 0.42, 0.54),
        _lamp(0.505, 0.33, 0.20, 0.34, 0.44), _lamp(0.505, -0.33, 0.20, 0.34, 0.44),
        *_axles((0.29, -0.29)),
    ]  # fmt: skip


def far_truck() -> list[Shape]:
    """Return a truck or a bus from far away."""
    return [
        box((-0.5, -0.5, 0.27), (0.25, 0.5, 1.0), at.REFLECTIVE), box((0.27, -0.47, 0.16), (0.49, 0.47, 0.76), at.BODY),
        box((-0.45, -0.5, 0.0), (0.42, 0.5, 0.27), at.TRIM),
    ]  # fmt: skip
