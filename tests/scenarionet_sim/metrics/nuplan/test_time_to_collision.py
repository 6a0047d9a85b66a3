"""Time to collision against shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely import affinity

from scenarionet_sim.metrics.nuplan import EgoDrive, SurroundingBoxes, time_to_collision
from scenarionet_sim.metrics.nuplan.time_to_collision import HORIZON, STEP

NUM = 25


def test_against_shapely():
    rng = np.random.default_rng(0)
    found = []
    for _ in range(40):
        position = np.vstack([[0, 0], rng.uniform(-25, 25, (NUM - 1, 2))])
        speed, heading = rng.uniform(0.5, 16, NUM), rng.uniform(-np.pi, np.pi, NUM)
        size = rng.uniform(0.5, 5, (NUM, 2))
        found.append((soonest(position, speed, heading, size), oracle(position, speed, heading, size)))
    assert [mine for mine, _ in found] == pytest.approx([theirs for _, theirs in found])
    assert sum(np.isfinite(theirs) for _, theirs in found) > 10


def soonest(position, speed, heading, size) -> float:
    still = np.zeros((1, 2))
    ego = EgoDrive(np.zeros(1), position[:1], heading[:1], speed[:1], still, *size[0], 1.2)
    rest = (values[None, 1:] for values in (position, heading, speed))
    others = SurroundingBoxes(*rest, size[1:], np.ones(NUM - 1, np.uint8), np.ones((1, NUM - 1), bool))
    (found,) = time_to_collision(ego, others, [], np.ones(1, bool), np.zeros(1, bool))
    return float(found)


def oracle(position, speed, heading, size) -> float:
    along = np.column_stack((np.cos(heading), np.sin(heading)))
    away = position - (position[0] - 1.2 * along[0])
    angle = np.abs((np.arctan2(away[:, 1], away[:, 0]) - heading[0] + np.pi) % (2 * np.pi) - np.pi)
    boxes = [rectangle(*row) for row in zip(position, heading, size, strict=True)]
    for ahead in np.arange(STEP, HORIZON, STEP):
        moved = [affinity.translate(b, *(v * ahead)) for b, v in zip(boxes, speed[:, None] * along, strict=True)]
        if any(angle[n] < np.radians(30) and shapely.intersects(moved[0], moved[n]) for n in range(1, len(boxes))):
            return float(ahead)
    return np.inf


def rectangle(position, heading, size) -> shapely.Polygon:
    half = shapely.box(-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2)
    return affinity.translate(affinity.rotate(half, heading, origin=(0, 0), use_radians=True), *position)
