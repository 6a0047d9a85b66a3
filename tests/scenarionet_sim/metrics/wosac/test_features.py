"""Features against the values of the owner's unit tests, and against slow, obvious computations."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_sim.metrics.wosac import kernels
from scenarionet_sim.metrics.wosac.features import central_difference, central_validity, kinematics

ALIGNED, WELL_ALIGNED = math.radians(75.0), math.radians(10.0)
NEVER = kernels.MAX_TIME


def nearest(boxes: np.ndarray, valid: np.ndarray | None = None, rounding: float = 0.0) -> list[float]:
    """Distance of the first of N boxes (N, T, 7: x, y, z, length, width, height, heading) to the others."""
    boxes = np.asarray(boxes, np.float64)
    valid = np.ones(boxes.shape[:2], np.bool_) if valid is None else np.asarray(valid)
    found = np.empty((1, 1, boxes.shape[1]), np.float32)
    kernels.nearest_object(
        np.ascontiguousarray(boxes[None, ..., :3]),
        np.ascontiguousarray(boxes[None, ..., 6]),
        np.ascontiguousarray(boxes[None, ..., 3:6], np.float32),
        valid[None],
        np.array([0]),
        rounding,
        found,
    )
    return found[0, 0].tolist()


def test_touching_and_distant_boxes():
    pairs = [
        ([0, 0, 0, 2, 1, 1, 0], [3, 0, 0, 4, 1, 1, 0]),
        ([0, 0, 0, 1, 1, 1, 0], [0, 1.5, 0, 1, 2, 1, 0]),
        ([0, 0, 0, 2, 1, 1, np.pi / 2], [1, 0, 0, 1, 1, 1, 0]),
        ([6, 0, 0, 2, 1, 1, np.pi], [-6, 0, 0, 2, 1, 1, 0]),
    ]
    boxes = np.array(pairs, float).transpose(1, 0, 2)
    assert nearest(boxes) == pytest.approx([0, 0, 0, 10], abs=1e-6)


def test_the_nearest_valid_object_counts():
    boxes = np.array([[[0, 0, 0, 1, 1, 1, 0]], [[6, 0, 0, 1, 1, 1, 0]], [[0, 11, 0, 1, 1, 1, 0]]], float)
    valid = np.array([[True, True, True], [True, True, False], [True, False, True]])
    assert nearest(np.repeat(boxes, 3, axis=1), valid) == pytest.approx([5, 5, 10])
    assert nearest(boxes, valid[:, :1] & [[True], [False], [False]]) == [np.float32(kernels.FAR)]


@pytest.mark.parametrize(
    ("rounding", "expected"), [(0.0, 0.0), (1.0, math.hypot(3, 3) - 3), (0.5, math.hypot(1.5, 1.5) - 1.5)]
)
def test_corners_are_rounded(rounding: float, expected: float):
    boxes = np.array([[[0, 0, 0, 2, 2, 1, 0]], [[4, 3, 0, 6, 4, 1, 0]]], float)
    assert nearest(boxes, rounding=rounding) == pytest.approx([expected], abs=1e-6)


box = st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(0.5, 9), st.floats(0.5, 4), st.floats(-np.pi, np.pi))


@given(box, box)
def test_distance_of_boxes_is_that_of_polygons(first: tuple[float, ...], second: tuple[float, ...]):
    rows = [[x, y, 0.0, length, width, 1.0, heading] for x, y, length, width, heading in (first, second)]
    (found,) = nearest(np.array(rows)[:, None])
    a, b = (outline(*row) for row in (first, second))
    if a.intersection(b).area > 1e-9:
        assert found <= 1e-5
        moves = [found * np.array([math.cos(angle), math.sin(angle)]) for angle in np.linspace(0, 2 * np.pi, 721)]
        freed = [shapely.affinity.translate(a, *(1.02 * move)).intersection(b).area for move in moves]
        assert min(freed) < 0.02 * max(1.0, a.area), "moving by the depth in some direction separates them"
    else:
        assert found == pytest.approx(a.distance(b), abs=1e-4)


def outline(x: float, y: float, length: float, width: float, heading: float) -> shapely.Polygon:
    square = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return shapely.affinity.translate(shapely.affinity.rotate(square, heading, (0, 0), use_radians=True), x, y)


@pytest.mark.parametrize(
    ("centres", "headings", "size", "speeds", "expected"),
    [
        (
            [[x, y] for y in (3, 0, -3) for x in (-3, 0, 3)],
            [0] * 9,
            (1, 1),
            [10, 6, 1] * 3,
            [2 / 4, 2 / 5, NEVER] * 3,
        ),
        ([[0, 0], [5, 0], [10, 0], [15, 0]], [0] * 4, (4, 2), [6, 10, 3, 1], [NEVER, 1 / 7, 1 / 2, NEVER]),
        (
            [[0, 0], [5, 0], [10, 0], [15, 0]],
            [0, ALIGNED + 0.01, 0, ALIGNED - 0.01],
            (4, 2),
            [10, 6, 3, 1],
            [6 / 7, NEVER, (3 - math.cos(ALIGNED - 0.01) * 2 - math.sin(ALIGNED - 0.01)) / 2, NEVER],
        ),
        ([[0, 0], [5, 2.1], [10, 1.1], [15, 0]], [0] * 4, (4, 2), [10, 6, 3, 1], [6 / 7, 1 / 3, 1 / 2, NEVER]),
        (
            [[0, 0], [5, 2.0], [10, -2.0]],
            [0, WELL_ALIGNED + 0.01, -WELL_ALIGNED + 0.01],
            (4, 2),
            [6, 3, 1],
            [(8 - math.cos(WELL_ALIGNED - 0.01) * 2 - math.sin(WELL_ALIGNED - 0.01)) / 5, NEVER, NEVER],
        ),
    ],
)
def test_time_to_the_object_ahead(centres, headings, size, speeds, expected):
    count = len(centres)
    position = np.zeros((1, count, 1, 3))
    position[0, :, 0, :2] = centres
    sizes = np.zeros((1, count, 1, 3), np.float32)
    sizes[..., :2] = size
    found = np.empty((1, count, 1), np.float32)
    kernels.time_to_object_ahead(
        position,
        np.array(headings, float)[None, :, None],
        sizes,
        np.array(speeds, float)[None, :, None],
        np.ones((1, count, 1), np.bool_),
        np.arange(count),
        found,
    )
    assert found[0, :, 0].tolist() == pytest.approx(expected, abs=1e-5)


# --- road edges -------------------------------------------------------------------------------------------

GRID = np.stack(np.meshgrid(np.linspace(-1, 4, 12), np.linspace(-1, 4, 12)), axis=-1).reshape(-1, 2)


def edge_distances(points: np.ndarray, *edges: list[list[float]], cyclic: bool = False) -> np.ndarray:
    """Signed distance of points (Q, 3) to edges, as that of boxes without extent."""
    lines = [np.array(edge, float) for edge in edges]
    joined = np.concatenate(lines)
    offsets = np.cumsum([0, *map(len, lines)])
    found = np.empty((1, len(points), 1), np.float32)
    kernels.edge_distance(
        np.ascontiguousarray(points[None, :, None], np.float64),
        np.zeros((1, len(points), 1)),
        np.zeros((1, len(points), 1, 3), np.float32),
        np.arange(len(points)),
        kernels.Edges(joined, offsets, np.full(len(lines), cyclic), kernels.blocks(joined, offsets)),
        found,
    )
    return found[0, :, 0]


def at(xy: np.ndarray, z: float = 0.0) -> np.ndarray:
    return np.column_stack([xy, np.full(len(xy), z)])


def test_the_left_of_an_edge_is_the_road():
    upwards = [[0, 0, 0], [0, 2, 0]]
    assert edge_distances(np.array([[-1.0, 1, 0], [2, 1, 0]]), upwards) == pytest.approx([-1, 2])
    beyond = edge_distances(np.array([[0.0, 1, 0], [3, -1, 0]]), [[0, 0, 0], [2, 0, 0]])
    assert np.abs(beyond) == pytest.approx([1, math.sqrt(2)])


def test_circle():
    turn = np.linspace(0, 2 * np.pi, 41)
    circle = np.column_stack([1.2 * np.cos(turn), 1.2 * np.sin(turn), np.zeros(41)])
    xy = np.stack(np.meshgrid(np.linspace(-2.4, 2.4, 10), np.linspace(-2.4, 2.4, 10)), axis=-1).reshape(-1, 2)
    assert edge_distances(at(xy), circle) == pytest.approx(np.linalg.norm(xy, axis=1) - 1.2, rel=0.02, abs=0.01)


@pytest.mark.parametrize("cyclic", [False, True])
def test_square(cyclic: bool):
    side = 0.8
    square = side * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0], [1, 1, 0]])
    xy = np.stack(np.meshgrid(np.linspace(-2, 2, 10), np.linspace(-2, 2, 10)), axis=-1).reshape(-1, 2)
    beyond = np.abs(xy) - side
    expected = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    assert edge_distances(at(xy), square, cyclic=cyclic) == pytest.approx(expected, abs=1e-6)


def test_two_edges_of_different_length():
    left = [[0, 10, 0], [0, 3, 0], [0, -3, 0], [0, -10, 0]]
    right = [[2, -10, 0], [2, 10, 0]]
    assert edge_distances(at(GRID), left, right) == pytest.approx(np.abs(GRID[:, 0] - 1) - 1, abs=1e-6)


@pytest.mark.parametrize(("edges_at", "points_at"), [(10.0, 8.0), (3.0, 1.0)])
def test_edges_on_another_level_do_not_count(edges_at: float, points_at: float):
    below, above = [[0, -10, -edges_at], [0, 10, -edges_at]], [[-10, 0, edges_at], [10, 0, edges_at]]
    assert edge_distances(at(GRID, -points_at), below, above) == pytest.approx(GRID[:, 0], abs=1e-6)
    assert edge_distances(at(GRID, points_at), below, above) == pytest.approx(-GRID[:, 1], abs=1e-6)


millimetres = st.integers(-50_000, 50_000)


@given(st.lists(st.tuples(millimetres, millimetres), min_size=40, max_size=60, unique=True))
def test_blocks_do_not_change_the_nearest_edge(points: list[tuple[int, int]]):
    line = np.column_stack([np.array(points) / 1000.0, np.zeros(len(points))])
    distance = np.abs(edge_distances(at(10 * GRID), line))
    expected = shapely.distance(shapely.points(10 * GRID), shapely.LineString(line[:, :2]))
    assert distance == pytest.approx(expected, abs=1e-3)


# --- kinematics -------------------------------------------------------------------------------------------


def test_kinematics_of_known_motions():
    position = np.array([[5.0, 0, 0], [6, 0, 0], [8, 0, 0], [9, 0, 0], [9, 0, 0]])
    speed, acceleration, turn, turn_acceleration = kinematics(position, np.array([0.0, 1, 3, 2, 0]), 1.0)
    assert speed[1:-1] == pytest.approx([1.5, 1.5, 0.5])
    assert acceleration[2] == pytest.approx(-0.5)
    assert turn[1:-1] == pytest.approx([1.5, 0.5, -1.5])
    assert turn_acceleration[2] == pytest.approx(-1.5)
    assert np.isnan(speed[[0, -1]]).all()
    assert np.isnan(acceleration[[0, 1, 3, 4]]).all()


def test_headings_wrap():
    heading = (5.0 * 0.1 * np.arange(20) + np.pi) % (2 * np.pi) - np.pi
    _, _, turn, _ = kinematics(np.zeros((20, 3)), heading, 0.1)
    assert turn[1:-1] == pytest.approx(5.0)


def test_central_differences_and_their_validity():
    assert central_difference(np.array([0.0, 0.5, 1.5, 2.0, 3.5]))[1:-1] == pytest.approx([0.75, 0.75, 1.0])
    valid = np.array([[1, 1, 1, 1, 1], [0, 1, 1, 0, 0], [0, 1, 0, 1, 0], [1, 0, 1, 0, 1]], bool)
    of_speed = np.array([[0, 1, 1, 1, 0], [0, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 1, 0, 1, 0]], bool)
    of_acceleration = np.array([[0, 0, 1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 1, 0, 0]], bool)
    assert (central_validity(valid) == of_speed).all()
    assert (central_validity(of_speed) == of_acceleration).all()


# --- lanes ------------------------------------------------------------------------------------------------


def test_nearest_lane_and_the_owners_choice():
    lanes = np.array([[0.0, 0], [10, 0], [0, 5], [10, 5]])
    query = np.array([[9.0, 1.0]])

    def find(official: bool) -> int:
        lane, segment = np.empty((2, 1), np.int64)
        kernels.nearest_lane(query, lanes, np.array([0, 2, 4]), 0, 2, official, lane, segment)
        return int(lane[0])

    assert find(official=False) == 0
    sums = [np.linalg.norm(query[0] - start + 0.9 * np.array([10, 0])) for start in ([0, 0], [0, 5])]
    assert find(official=True) == int(np.argmin(sums))


def test_all_objects_are_looked_at():
    """The evaluated object, one that is not valid, and far ones come before the nearest."""
    row = [0, 0, 0, 1, 1, 1, 0]
    boxes = np.array([[row], [[4, 0, 0, 1, 1, 1, 0]], [[30, 0, 0, 1, 1, 1, 0]], [[60, 0, 0, 1, 1, 1, 0]],
                      [[7, 0, 0, 1, 1, 1, 0]], [[90, 0, 0, 1, 1, 1, 0]], [[6, 0, 0, 1, 1, 1, 0]]], float)  # fmt: skip
    valid = np.ones((7, 1), np.bool_)
    valid[1] = False
    assert nearest(boxes, valid) == pytest.approx([5])
