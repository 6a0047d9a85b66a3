"""nuScenes centrelines: points on Dubins paths agree with small integration steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.nuscenes.dubins import SPACING, are_paths, centerlines
from tests.fixtures.nuscenes_world import drive

LENGTHS = st.lists(st.one_of(st.just(0.0), st.floats(0.01, 40.0)), min_size=3, max_size=3)


def path(start: Any, shape: str, radius: float, lengths: list[float]) -> dict[str, Any]:
    return {"start_pose": list(start), "shape": shape, "radius": radius, "segment_length": lengths}


@given(
    start=st.tuples(st.floats(-3000, 3000), st.floats(-3000, 3000), st.floats(-7, 7)),
    shape=st.sampled_from(["LSR", "RSR", "LSL", "RSL", "LRL", "RLR"]),
    radius=st.floats(4.0, 1000.0),
    lengths=LENGTHS,
)
def test_points_match_integrated_path(
    start: tuple[float, float, float], shape: str, radius: float, lengths: list[float]
) -> None:
    points = centerlines([[path(start, shape, radius, lengths)]])[0]
    driven = drive(start, shape, radius, lengths)
    assert np.abs(points[0] - start[:2]).max() < 1e-9
    assert np.abs(points[-1] - driven[-1, :2]).max() < 1e-3
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(driven[:, :2], axis=0).T))])
    wanted = np.linspace(0.0, travelled[-1], len(points))
    for axis in range(2):
        np.testing.assert_allclose(points[:, axis], np.interp(wanted, travelled, driven[:, axis]), atol=2e-3)
    assert len(points) == max(int(np.ceil(sum(lengths) / SPACING - 1e-9)), 1) + 1


def test_paths_of_a_lane_are_joined() -> None:
    first, second = path((0, 0, 0), "LSL", 10.0, [0.0, 3.5, 0.0]), path((3.5, 0, 0), "LSL", 10.0, [0.0, 2.0, 0.0])
    apart = path((9.0, 1.0, 0), "LSL", 10.0, [0.0, 1.0, 0.0])
    joined, empty, broken = centerlines([[first, second], [], [first, apart]])
    np.testing.assert_allclose(joined[:, 0], [0.0, 0.875, 1.75, 2.625, 3.5, 4.5, 5.5])
    assert empty.shape == (0, 2)
    np.testing.assert_allclose(broken[-3:, 0], [3.5, 9.0, 10.0])
    assert len(centerlines([])) == 0
    assert [len(line) for line in centerlines([[], []])] == [0, 0]


@pytest.mark.parametrize(
    "change",
    [
        {"shape": "LXL"},
        {"shape": "LS"},
        {"radius": 0.0},
        {"radius": float("nan")},
        {"segment_length": [1.0, -1.0, 1.0]},
        {"segment_length": [1.0, 1.0]},
        {"segment_length": [1.0, float("inf"), 1.0]},
        {"start_pose": [0.0, 0.0]},
        {"start_pose": [0.0, float("inf"), 0.0]},
        {"start_pose": None},
        {"radius": "10"},
        {"segment_length": [1.0, 1e12, 1.0]},
    ],
)
def test_invalid_paths_are_found(change: dict[str, Any]) -> None:
    good = path((0, 0, 0), "LSL", 10.0, [1.0, 2.0, 3.0])
    assert are_paths([good, good])
    assert not are_paths([good, good | change])
    assert not are_paths([{key: value for key, value in good.items() if key not in change}])
