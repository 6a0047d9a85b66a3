"""The lane of an object against shapely, and the path along its successors."""

from __future__ import annotations

from itertools import chain, pairwise

import numpy as np
import pytest
import shapely

from scenarionet_sim.arrays.structures import Lanes
from scenarionet_sim.roads.lane_kernels import find_lanes, follow_lanes

BESIDE = 2.5


def random_lanes(rng, count=12):
    """Lanes of four points, each wandering in its own direction."""
    heading = rng.uniform(-np.pi, np.pi, (count, 1)) + np.cumsum(rng.normal(0.0, 0.3, (count, 3)), axis=1)
    steps = rng.uniform(3.0, 12.0, (count, 3, 1)) * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    start = rng.uniform(-15.0, 15.0, (count, 1, 2))
    return np.concatenate([start, start + np.cumsum(steps, axis=1)], axis=1).astype(np.float32)


def nearest_lane(lanes, place, heading):
    """Return distance, row and arc length of the nearest lane segment along ``heading``."""
    best = BESIDE, -1.0, 0.0
    for row, lane in enumerate(lanes.astype(np.float64)):
        for k, (one, other) in enumerate(pairwise(lane)):
            line, (dx, dy) = shapely.LineString([one, other]), other - one
            if np.cos(heading - np.arctan2(dy, dx)) > np.cos(np.pi / 4) and line.distance(place) < best[0]:
                along = shapely.LineString(lane[: k + 1]).length if k else 0.0
                best = line.distance(place), row, along + line.project(place)
    return best


@pytest.mark.parametrize("seed", range(6))
def test_nearest_lane_in_the_direction_of_travel(seed):
    rng = np.random.default_rng(seed)
    lanes = random_lanes(rng)
    places, headings = rng.uniform(-20.0, 20.0, (150, 2)).astype(np.float32), rng.uniform(-4.0, 4.0, 150)
    found = np.tile([-1.0, 0.0, BESIDE], (150, 1))
    offsets = np.arange(0, 4 * len(lanes) + 1, 4, dtype=np.int32)
    find_lanes(places, headings.astype(np.float32), lanes.reshape(-1, 2), offsets, found)
    wanted = [nearest_lane(lanes, shapely.Point(*map(float, p)), float(np.float32(h)))
              for p, h in zip(places, headings, strict=True)]  # fmt: skip
    assert (found[:, 0] >= 0).sum() > 3
    np.testing.assert_allclose(found[:, [2, 0, 1]], wanted, atol=1e-5)


def follow(lines, successors, turn, lane, along, count=8):
    """Return points every 2 m from ``along`` on a lane."""
    way, number = np.zeros((1, count, 2)), np.zeros(1, np.int32)
    offsets, successor_offsets = (np.cumsum([0, *map(len, lists)]).astype(np.int32) for lists in (lines, successors))
    points, rows = np.concatenate(lines).astype(np.float32), np.array([*chain(*successors)], np.int32)
    lanes = Lanes(points, offsets, rows, successor_offsets, np.array(turn))
    follow_lanes(np.array([[lane, along, 0.0]]), lanes, 2.0, way, number)
    return way[0, : number[0]]


EAST = [(0.0, 0.0), (4.0, 0.0)]


def test_path_takes_the_straightest_lane_and_ends_with_the_last_one():
    north, onward = [(4.0, 0.0), (4.0, 10.0)], [(4.0, 0.0), (9.0, 0.0)]
    way = follow([EAST, north, onward], [[1, 2], [], []], [0.0, 1.5, 0.1], lane=0, along=1.0)
    np.testing.assert_allclose(way, [(1.0, 0.0), (3.0, 0.0), (5.0, 0.0), (7.0, 0.0), (9.0, 0.0)])


def test_path_follows_a_cycle_of_lanes():
    back = [(4.0, 0.0), (0.0, 0.0)]
    way = follow([EAST, back], [[1], [0]], [0.0, 0.0], lane=0, along=0.0)
    np.testing.assert_allclose(way[:, 0], [0, 2, 4, 2, 0, 2, 4, 2])


def test_zero_length_lanes_and_positions_off_all_lanes_have_no_path():
    assert len(follow([EAST, [(4.0, 0.0)]], [[1], [1]], [0.0, 0.0], lane=0, along=0.0)) == 3
    assert len(follow([EAST], [[]], [0.0], lane=-1, along=0.0)) == 0
