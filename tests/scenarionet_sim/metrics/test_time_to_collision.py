"""Time to collision against hand-computed values and shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from shapely import affinity

from scenarionet_sim.metrics.time_to_collision import HORIZON, STEP, time_to_collision

CAR = 4.0, 2.0, 1.5


def soonest(position, velocity, heading=None, size=None, touched=None, between=False, rear=1.2) -> np.ndarray:
    position, velocity = np.array([position], float), np.array([velocity], float)
    num = position.shape[1]
    return time_to_collision(
        position,
        np.array([heading if heading is not None else np.zeros(num)], float),
        velocity,
        np.array(size if size is not None else [CAR] * num, float),
        np.ones((1, num), bool),
        np.array([touched if touched is not None else np.zeros(num)], bool),
        np.array([between]),
        0,
        rear,
    )


@pytest.mark.parametrize(
    ("gap", "speed", "wanted"), [(10.05, 10.0, 1.1), (9.95, 10.0, 1.0), (1.0, 12.0, 0.1), (30.5, 10.0, np.inf)]
)
def test_straight_ahead(gap, speed, wanted):
    assert soonest([[0, 0], [4 + gap, 0]], [[speed, 0], [0, 0]]) == pytest.approx([wanted])


def test_only_objects_ahead_count():
    side = [[0, 0], [0, 5.1]], [[10, 0], [10, -5]]
    assert soonest(*side).tolist() == [np.inf]
    assert soonest(*side, between=True) == pytest.approx([0.7]), "3.1 m between the boxes, 5 m/s"
    behind = [[0, 0], [-10, 0]], [[5, 0], [15, 0]]
    assert soonest(*behind, between=True).tolist() == [np.inf]


def test_stationary_and_initially_touching_objects():
    ahead = [[0, 0], [8, 0]]
    assert soonest(ahead, [[0.004, 0], [-10, 0]]).tolist() == [np.inf]
    assert soonest(ahead, [[10, 0], [0, 0]], touched=[0, 1]).tolist() == [np.inf]
    assert np.isfinite(soonest(ahead, [[10, 0], [0, 0]])).all()


def test_against_shapely():
    rng, num = np.random.default_rng(0), 25
    found = []
    for _ in range(40):
        position = np.vstack([[0, 0], rng.uniform(-25, 25, (num - 1, 2))])
        velocity, heading = rng.normal(0, 8, (num, 2)), rng.uniform(-np.pi, np.pi, num)
        size = rng.uniform(0.5, 5, (num, 3))
        found.append((soonest(position, velocity, heading, size)[0], oracle(position, velocity, heading, size)))
    assert [mine for mine, _ in found] == pytest.approx([theirs for _, theirs in found])
    assert sum(np.isfinite(theirs) for _, theirs in found) > 10


def oracle(position, velocity, heading, size) -> float:
    axle = position[0] - 1.2 * np.array([np.cos(heading[0]), np.sin(heading[0])])
    away = position - axle
    angle = np.abs((np.arctan2(away[:, 1], away[:, 0]) - heading[0] + np.pi) % (2 * np.pi) - np.pi)
    boxes = [rectangle(*row) for row in zip(position, heading, size, strict=True)]
    for ahead in np.arange(STEP, HORIZON, STEP):
        moved = [affinity.translate(b, *(v * ahead)) for b, v in zip(boxes, velocity, strict=True)]
        if any(angle[n] < np.radians(30) and shapely.intersects(moved[0], moved[n]) for n in range(1, len(boxes))):
            return float(ahead)
    return np.inf


def rectangle(position, heading, size) -> shapely.Polygon:
    half = shapely.box(-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2)
    return affinity.translate(affinity.rotate(half, heading, origin=(0, 0), use_radians=True), *position)
