"""The route ahead as a line to drive along."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.planners.way import Way

RADIUS, AXLE = 20.0, 1.5


@pytest.fixture
def circle() -> Way:
    """A left bend around (0, 20) that begins at the origin, towards +x."""
    arc = np.arange(-10.0, 30.0)
    angle = arc / RADIUS
    points = RADIUS * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return Way(points, angle, arc, 0.0, np.inf, AXLE)


def test_the_rear_axle_is_on_the_way_and_moves_along_the_heading(circle: Way):
    poses = circle.pose(np.linspace(0.0, 20.0, 9))
    rear = poses[:, :2] - AXLE * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    assert rear == pytest.approx(circle.at(np.linspace(0.0, 20.0, 9) - AXLE)[:, :2]), (
        "the centre is at the distance asked"
    )
    from_middle = rear - [0.0, RADIUS]
    assert np.hypot(*from_middle.T) == pytest.approx(RADIUS, abs=0.01), "chords of a metre are 6 mm inside"
    assert (np.arctan2(from_middle[:, 1], from_middle[:, 0]) + np.pi / 2) == pytest.approx(poses[:, 2], abs=0.01)
    assert np.hypot(*(poses[:, :2] - [0.0, RADIUS]).T) == pytest.approx(np.hypot(RADIUS, AXLE), abs=0.01)


def test_the_way_itself(circle: Way):
    assert circle.at(10.0) == pytest.approx([*circle.points[20], 0.5])
    inside = circle.at(10.0, 2.0)
    assert np.hypot(inside[0], inside[1] - RADIUS) == pytest.approx(RADIUS - 2.0)
