"""Cars, vans, trucks and buses, and their interior.

Shapes are in a unit box: x from -0.5 (rear) to 0.5, y from -0.5 to 0.5 (left), z from 0 to 1.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.shapes import Shape, box, loft, outward, tube

_ROUND = 30
"""Corners of what is round from close up, a multiple of the ten sectors of a wheel's disc."""


def _wheels(axles: tuple[float, ...], radius: float, length: float, height: float, tread: float) -> list[Shape]:
    """Return two wheels per axle, as parts 1, 2 (front) and following, for a typical length and height."""
    shapes = []
    rx, rz = radius / length, radius / height
    angles = np.arange(_ROUND) * 2.0 * np.pi / _ROUND
    rim = np.stack([0.66 * rx * np.cos(angles), np.zeros(_ROUND), 0.66 * rz * np.sin(angles)], axis=1)
    fan = np.array([(_ROUND, k, (k + 1) % _ROUND) for k in range(_ROUND)], np.int32)
    spokes = np.where(np.arange(_ROUND) * 10 // _ROUND % 2 == 0, at.METAL, at.TRIM).astype(np.uint8)
    for number, x in enumerate(axles):
        for side in (1.0, -1.0):
            part = min(2 * number + (1 if side > 0 else 2), 4)
            low, high = (side * 0.5, side * (0.5 - tread))
            tyre = tube((x, low, rz), (x, high, rz), ((rx, rz), (rx, rz)), at.TYRE, _ROUND)
            disc = np.append(rim, np.zeros((1, 3)), axis=0) + np.array([x, side * 0.504, rz])
            shapes.append(replace(tyre, part=part))
            shapes.append(Shape(disc, fan[:, ::-1] if side > 0 else fan, spokes, part))
    return shapes


def _arches(axles: tuple[float, ...], middle: float, radii: tuple[float, float], sill: float) -> list[Shape]:
    """Return what is dark around the wheels, above the lower edge of the body."""
    tubes = [
        tube((x, side * 0.494, middle), (x, side * 0.36, middle), (radii, radii), at.TRIM, _ROUND)
        for x in axles for side in (1.0, -1.0)
    ]  # fmt: skip
    return [replace(each, points=np.maximum(each.points, (-1.0, -1.0, sill))) for each in tubes]


def hull(stations: list[tuple[float, float, float, float, float, float]], *, is_coarse: bool = False) -> Shape:
    """Return a car's body through its cross-sections.

    Args:
        stations: From the rear: x, half width at the belt and at the roof, height of the bottom, belt and roof.
        is_coarse: Whether cross-sections have 10 corners instead of 14.
    """
    kept = [0, 2, 4, 5, 6] if is_coarse else list(range(7))
    glass, top, trim = ([2, 6], [3, 4, 5], [9]) if is_coarse else ([4, 8], [5, 6, 7], [0, 12, 13])
    rings, kinds = [], []
    for x, wide, narrow, bottom, belt, roof in stations:
        middle = bottom + 0.55 * (belt - bottom)
        half = [
            (0.80 * wide, bottom), (0.97 * wide, bottom + 0.25 * (middle - bottom)), (wide, middle),
            (0.965 * wide, belt - 0.02), (0.93 * wide, belt), (narrow, roof - 0.045 * (roof > belt + 0.05)),
            (0.82 * narrow, roof),
        ]  # fmt: skip
        right = [(x, -half[k][0], half[k][1]) for k in kept]
        left = [(x, half[k][0], half[k][1]) for k in reversed(kept)]
        rings.append(right + left)
    sides = len(rings[0])
    for rear, front in pairwise(stations):
        row = np.full(sides, at.BODY)
        has_glass = rear[5] > rear[4] + 0.05 or front[5] > front[4] + 0.05
        is_pillar = front[0] - rear[0] < 0.035
        if has_glass and not is_pillar:
            row[glass] = at.GLASS
        is_slope = abs(front[5] - rear[5]) > 0.12
        if has_glass and is_slope:
            row[top] = at.GLASS
        row[trim] = at.TRIM
        kinds.append(row)
    return outward(loft(rings, np.array(kinds), (at.BODY, at.BODY)))


def car() -> list[Shape]:
    """Return a car."""
    body = hull([
        (-0.50, 0.40, 0.36, 0.24, 0.52, 0.54), (-0.485, 0.46, 0.40, 0.19, 0.60, 0.62),
        (-0.40, 0.485, 0.40, 0.14, 0.635, 0.66), (-0.26, 0.49, 0.375, 0.12, 0.635, 0.955),
        (-0.23, 0.49, 0.375, 0.12, 0.635, 0.975), (-0.06, 0.49, 0.38, 0.12, 0.63, 1.0),
        (-0.03, 0.49, 0.38, 0.12, 0.63, 1.0), (0.05, 0.49, 0.375, 0.12, 0.625, 0.985),
        (0.215, 0.49, 0.42, 0.12, 0.605, 0.645), (0.40, 0.475, 0.41, 0.14, 0.545, 0.565),
        (0.475, 0.45, 0.38, 0.17, 0.47, 0.49), (0.50, 0.39, 0.33, 0.22, 0.42, 0.44),
    ])  # fmt: skip
    details = [
        box((-0.503, 0.23, 0.44), (-0.47, 0.445, 0.545), at.TAIL_LAMP),
        box((-0.503, -0.445, 0.44), (-0.47, -0.23, 0.545), at.TAIL_LAMP),
        box((-0.504, -0.14, 0.36), (-0.49, 0.14, 0.44), at.REFLECTIVE),
        box((0.46, 0.25, 0.34), (0.496, 0.43, 0.435), at.HEADLAMP),
        box((0.46, -0.43, 0.34), (0.496, -0.25, 0.435), at.HEADLAMP),
        box((0.48, -0.22, 0.24), (0.506, 0.22, 0.36), at.TRIM),
        box((-0.506, -0.42, 0.17), (-0.45, 0.42, 0.27), at.TRIM),
        box((0.13, 0.47, 0.60), (0.17, 0.545, 0.69), at.BODY), box((0.13, -0.545, 0.60), (0.17, -0.47, 0.69), at.BODY),
    ]  # fmt: skip
    axles = 0.30, -0.29
    arches, wheels = _arches(axles, 0.21, (0.083, 0.25), 0.19), _wheels(axles, 0.325, 4.6, 1.55, 0.12)
    return [body, *details, *arches, *wheels]


def van() -> list[Shape]:
    """Return a van."""
    body = hull([
        (-0.50, 0.46, 0.42, 0.16, 0.52, 0.90), (-0.485, 0.485, 0.44, 0.12, 0.53, 0.985),
        (-0.30, 0.49, 0.45, 0.10, 0.53, 1.0), (-0.27, 0.49, 0.45, 0.10, 0.53, 1.0), (0.0, 0.49, 0.45, 0.10, 0.53, 1.0),
        (0.03, 0.49, 0.45, 0.10, 0.53, 0.995), (0.20, 0.49, 0.44, 0.10, 0.53, 0.95),
        (0.36, 0.48, 0.43, 0.11, 0.52, 0.56), (0.47, 0.46, 0.40, 0.13, 0.44, 0.47),
        (0.50, 0.42, 0.36, 0.17, 0.38, 0.40),
    ])  # fmt: skip
    details = [
        box((-0.503, s * 0.44 - 0.03, 0.42), (-0.47, s * 0.44 + 0.03, 0.62), at.TAIL_LAMP) for s in (1.0, -1.0)
    ] + [box((0.465, s * 0.34 - 0.09, 0.31), (0.497, s * 0.34 + 0.09, 0.39), at.HEADLAMP) for s in (1.0, -1.0)]
    details += [box((-0.504, -0.12, 0.30), (-0.49, 0.12, 0.37), at.REFLECTIVE)]
    axles = 0.31, -0.30
    arches, wheels = _arches(axles, 0.17, (0.078, 0.205), 0.16), _wheels(axles, 0.34, 5.4, 2.0, 0.12)
    return [body, *details, *arches, *wheels]


def truck() -> list[Shape]:
    """Return a lorry with its load."""
    cab = [
        box((0.27, -0.47, 0.16), (0.495, 0.47, 0.44), at.BODY),
        box((0.27, -0.47, 0.44), (0.49, 0.47, 0.76), at.BODY, (0.92, 0.94)),
        box((0.395, -0.42, 0.48), (0.494, 0.42, 0.72), at.GLASS, (0.9, 0.95)),
        box((0.33, -0.474, 0.48), (0.45, 0.474, 0.68), at.GLASS, (0.9, 0.96)),
        box((0.48, -0.30, 0.20), (0.503, 0.30, 0.34), at.TRIM),
    ]
    load = [
        box((-0.5, -0.5, 0.27), (0.25, 0.5, 1.0), at.REFLECTIVE),
        box((-0.49, -0.36, 0.14), (0.28, 0.36, 0.27), at.TRIM),
        box((-0.503, -0.5, 0.27), (-0.499, 0.5, 0.30), at.ORANGE),
    ]  # fmt: skip
    lamps = [box((-0.505, s * 0.36 - 0.08, 0.2), (-0.48, s * 0.36 + 0.08, 0.26), at.TAIL_LAMP) for s in (1.0, -1.0)]
    lamps += [box((0.48, s * 0.38 - 0.07, 0.22), (0.502, s * 0.38 + 0.07, 0.30), at.HEADLAMP) for s in (1.0, -1.0)]
    return [*cab, *load, *lamps, *_wheels((0.37, -0.32), 0.48, 8.0, 3.2, 0.13)]


def bus() -> list[Shape]:
    """Return a bus."""
    body = [
        box((-0.5, -0.49, 0.10), (0.5, 0.49, 0.50), at.BODY), box((-0.495, -0.48, 0.50), (0.493, 0.48, 0.82), at.GLASS),
        box((-0.5, -0.49, 0.82), (0.497, 0.49, 1.0), at.BODY, (0.99, 0.93)),
    ]  # fmt: skip
    pillars = [
        box((x - 0.008, s * 0.483 - 0.005, 0.50), (x + 0.008, s * 0.483 + 0.005, 0.82), at.BODY)
        for x in np.linspace(-0.49, 0.46, 8) for s in (1.0, -1.0)
    ]  # fmt: skip
    lamps = [box((-0.503, s * 0.42 - 0.04, 0.3), (-0.49, s * 0.42 + 0.04, 0.44), at.TAIL_LAMP) for s in (1.0, -1.0)]
    lamps += [box((0.49, s * 0.38 - 0.07, 0.18), (0.503, s * 0.38 + 0.07, 0.25), at.HEADLAMP) for s in (1.0, -1.0)]
    return [*body, *pillars, *lamps, *_wheels((0.30, -0.28), 0.48, 12.0, 3.2, 0.11)]


def interior() -> list[Shape]:
    """Return what a driver sees of a car: bonnet, dashboard, steering wheel, pillars and the edge of the roof."""
    bonnet = outward(loft(
        [
            [(x, -w, low), (x, w, low), (x, w, high), (x, 0.0, high + 0.02), (x, -w, high)]
            for x, w, low, high in ((0.20, 0.46, 0.3, 0.595), (0.38, 0.44, 0.3, 0.55), (0.49, 0.38, 0.3, 0.46))
        ], at.BODY, (at.BODY, at.BODY),
    ))  # fmt: skip
    pillars = [
        tube((0.22, s * 0.46, 0.58), (0.03, s * 0.37, 0.98), ((0.012, 0.028), (0.012, 0.028)), at.INTERIOR, 6)
        for s in (1.0, -1.0)
    ]
    angles = np.linspace(0.0, 2.0 * np.pi, 13)
    rim = [
        tube(
            (0.055 + 0.02 * np.sin(a), 0.2 + 0.10 * np.cos(a), 0.60 + 0.11 * np.sin(a)),
            (0.055 + 0.02 * np.sin(b), 0.2 + 0.10 * np.cos(b), 0.60 + 0.11 * np.sin(b)),
            ((0.006, 0.012), (0.006, 0.012)), at.TYRE, 5,
        )
        for a, b in pairwise(angles.tolist())
    ]  # fmt: skip
    return [
        bonnet, *pillars, *rim, box((0.09, -0.47, 0.40), (0.215, 0.47, 0.615), at.INTERIOR, (0.75, 0.98)),
        box((0.05, 0.17, 0.57), (0.06, 0.23, 0.62), at.TRIM), box((0.07, 0.10, 0.60), (0.12, 0.30, 0.645), at.TRIM),
        box((0.0, -0.40, 0.965), (0.05, 0.40, 1.0), at.INTERIOR),
        box((0.03, -0.06, 0.90), (0.04, 0.06, 0.945), at.TRIM),
    ]  # fmt: skip
