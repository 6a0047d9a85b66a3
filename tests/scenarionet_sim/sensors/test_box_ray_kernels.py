"""Rays at boxes, against the slabs of every box and ray in turn."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.boxes import Boxes, write_boxes
from scenarionet_sim.arrays.log import HEADING
from scenarionet_sim.arrays.structures import StateArrays
from scenarionet_sim.roads.ray_kernels import RayFan
from scenarionet_sim.sensors.base import directions, table
from scenarionet_sim.sensors.box_ray_kernels import RayMemory, ranges_to_boxes

REACH = 50.0


@kernel
def cast_at_boxes(now, boxes, rays, memory, out):
    """Cast the rays of the first object of each world, with float64 output."""
    for w in range(len(out)):
        write_boxes(now.motion.shape[1], now.motion[w], now.size[w], now.present[w], boxes)
        ranges_to_boxes(w, 0, now, boxes, rays, memory, out[w])


def cast(motion, size, rays):
    """Shares that the first object of each world sees."""
    (worlds, objects), found = motion.shape[:2], np.empty((len(motion), rays))
    kinds, present = np.ones((worlds, objects), np.uint8), np.ones((worlds, objects), np.bool_)
    now = StateArrays(motion, np.zeros((worlds, objects, 2)), present, size, kinds, np.zeros(worlds, np.int32))
    memory = RayMemory.of(rays, objects)
    cast_at_boxes(now, Boxes.of(objects), RayFan(directions(rays), REACH, table(None)), memory, found)
    return found


def by_slabs(motion, size, rays):
    """The same by the distances at which each ray enters and leaves the two slabs of each box."""
    angle = motion[:, :1, HEADING] + np.arange(rays) * 2 * np.pi / rays  # (W, R)
    turn = angle[:, None] - motion[:, 1:, None, HEADING]  # (W, N, R)
    offset, heading = motion[:, :1, :2] - motion[:, 1:, :2], motion[:, 1:, HEADING]
    cos, sin = np.cos(heading), np.sin(heading)
    start = np.stack(
        [cos * offset[..., 0] + sin * offset[..., 1], cos * offset[..., 1] - sin * offset[..., 0]], axis=-1
    )
    forward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    with np.errstate(divide="ignore"):
        ends = (np.stack([-size[:, 1:, :2], size[:, 1:, :2]]) / 2 - start)[..., None, :] / forward
    enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    hit = (enter <= leave) & (leave >= 0)
    return np.minimum(np.where(hit, np.maximum(enter, 0.0) / REACH, 1.0).min(axis=1), 1.0)


@pytest.mark.parametrize("rays", [1, 2, 3, 7, 120, 1000])
def test_ranges_are_those_of_the_slabs(rays):
    rng, shape = np.random.default_rng(rays), (200, 9)
    motion, size = np.zeros((*shape, 7)), rng.uniform(0.0, [12.0, 3.0, 2.0], (*shape, 3))
    motion[..., :2] = 1000.0 + rng.normal(size=(*shape, 2)) * rng.choice([2.0, 10.0, 40.0], (*shape, 1))
    motion[..., HEADING] = rng.uniform(-4.0, 4.0, shape)
    found = cast(motion, size, rays)
    np.testing.assert_allclose(found, by_slabs(motion, size, rays), atol=1e-9)
    assert 0.05 < (found < 1.0).mean() < 0.95


def test_boxes_without_length_or_width_are_seen_from_the_side():
    motion, size = np.zeros((3, 2, 7)), np.zeros((3, 2, 3))
    motion[:, 1, 0] = 10.0
    size[0, 1, 1], size[1, 1, 0] = 2.0, 2.0  # a line across, a line along, a point
    np.testing.assert_allclose(cast(motion, size, 4)[0], [0.2, 1.0, 1.0, 1.0])
    assert np.isfinite(cast(motion, size, 4)).all()
    motion[:, 1, 0] = 0.0
    assert (cast(motion, size, 4) >= 0.0).all()


@pytest.mark.parametrize("offset", [0.0, 0.5, 1.0])
def test_an_agent_in_or_on_the_edge_of_a_box_is_inside(offset):
    motion, size = np.zeros((1, 2, 7)), np.full((1, 2, 3), 2.0)
    motion[0, 1, 0] = offset
    np.testing.assert_array_equal(cast(motion, size, 8), 0.0)
