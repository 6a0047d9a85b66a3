"""The gap to the nearest box against shapely's distances and hand-made cases."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.statistics.summary import nearest_box

sides = st.floats(0.1, 20)
boxes = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4), sides, sides)


def polygon(box) -> shapely.Polygon:
    """The box by shapely's own rotation."""
    x, y, heading, length, width = box
    square = shapely.box(x - length / 2, y - width / 2, x + length / 2, y + width / 2)
    return shapely.affinity.rotate(square, heading, origin=(x, y), use_radians=True)


@given(
    grid=st.integers(1, 4).flatmap(
        lambda steps: st.lists(st.lists(st.tuples(boxes, st.booleans()), min_size=steps, max_size=steps), min_size=1)
    ),
    ego=st.integers(0, 100),
)
def test_nearest_gap_matches_shapely(grid, ego):
    ego %= len(grid)
    found = nearest_box(
        np.array([[box for box, _ in row] for row in grid]), np.array([[seen for _, seen in row] for row in grid]), ego
    )
    wanted = [
        polygon(mine).distance(polygon(theirs))
        for row, others in enumerate(grid)
        for (mine, i_am), (theirs, they_are) in zip(grid[ego], others, strict=True)
        if row != ego and i_am and they_are
    ]
    assert found == pytest.approx(min(wanted, default=math.inf), abs=1e-6)


@pytest.mark.parametrize(
    ("second", "gap"),
    [
        ((5.0, 0.0, 0.0, 4.0, 2.0), 1.0),  # bumper to bumper
        ((4.0, 0.0, 0.0, 4.0, 2.0), 0.0),  # touching
        ((0.1, 0.1, 1.0, 0.5, 0.5), 0.0),  # inside
        ((0.0, 0.0, math.pi / 2, 9.0, 0.2), 0.0),  # a cross: no corner of one is inside the other
        ((7.0, 5.0, 0.0, 4.0, 2.0), math.hypot(3, 3)),  # corner to corner
        ((2.0 + math.sqrt(2), 0.0, math.pi / 4, 2.0, 2.0), 0.0),  # a corner on a side
    ],
)
@pytest.mark.parametrize("ego", [0, 1])
def test_gap_of_known_boxes(second, gap, ego):
    pair = np.array([[(0.0, 0.0, 0.0, 4.0, 2.0)], [second]])
    assert nearest_box(pair, np.ones((2, 1), np.bool_), ego) == pytest.approx(gap, abs=1e-9)
