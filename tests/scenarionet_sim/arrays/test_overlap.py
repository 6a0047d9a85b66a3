"""Overlap of boxes, against shapely and against the box distance of the lake's statistics."""

from __future__ import annotations

import numpy as np
import shapely

from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.statistics.summary import nearest_box
from scenarionet_sim.arrays.boxes import Boxes, write_boxes
from scenarionet_sim.arrays.log import HEADING, Z
from scenarionet_sim.arrays.overlap import touch


@kernel(allocates=False)
def find_contacts(agents, motion, size, object_type, present, boxes, contacts, hits):
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        write_boxes(motion.shape[1], motion[w], size[w], present[w], boxes)
        hits[a] = touch(n, (motion[w], size[w], object_type[w]), boxes, contacts[a]) if present[w, n] else 0


def make_boxes(position, heading, z, size):
    """Return motion and size of stationary boxes."""
    motion = np.zeros((*heading.shape, 7))
    motion[..., :2], motion[..., HEADING], motion[..., Z] = position, heading, z
    return motion, np.ascontiguousarray(size)


def contacts_of(agents, motion, size, object_type, present):
    contacts = np.zeros((len(agents), motion.shape[1]), np.bool_)
    hits = np.full(len(agents), 99, np.uint32)
    find_contacts(agents, motion, size, object_type, present, Boxes.of(motion.shape[1]), contacts, hits)
    return contacts, hits


def test_contacts_are_the_overlapping_rectangles_at_the_same_height():
    rng, shape = np.random.default_rng(0), (3, 40)
    position, heading = rng.uniform(-15, 15, (*shape, 2)), rng.uniform(-np.pi, np.pi, shape)
    z, size = rng.choice([0.0, 4.0], shape), rng.uniform(0.3, 6, (*shape, 3))
    object_type, present = rng.integers(1, 7, shape).astype(np.uint8), rng.random(shape) < 0.8
    agents = np.argwhere(np.ones(present.shape)).astype(np.int32, order="C")
    contacts, hits = contacts_of(agents, *make_boxes(position, heading, z, size), object_type, present)
    boxes = shapely.polygons(box_corners(position, heading, size[..., 0], size[..., 1]))
    assert contacts.sum() > 50
    for (w, n), row, hit in zip(agents, contacts, hits, strict=True):
        touch = shapely.intersects(boxes[w, n], boxes[w]) & present[w] & present[w, n]
        touch &= 2 * np.abs(z[w] - z[w, n]) <= size[w, :, 2] + size[w, n, 2]
        touch[n] = False
        np.testing.assert_array_equal(row, touch)
        assert {k for k in range(12) if hit >> k & 1} == set(object_type[w][touch].tolist())


def test_overlap_is_a_distance_of_zero():
    rng = np.random.default_rng(1)
    first, second = rng.uniform([-4, -4, -3, 1, 1], [4, 4, 3, 5, 3], (2, 500, 5))
    both = np.stack([first, second], axis=1)
    boxes = make_boxes(both[..., :2], both[..., 2], 0.0, np.insert(both[..., 3:], 2, 1.5, axis=-1))
    agents = np.column_stack([np.arange(500), np.zeros(500)]).astype(np.int32)
    contacts, _ = contacts_of(agents, *boxes, np.ones((500, 2), np.uint8), np.ones((500, 2), np.bool_))
    gap = [
        nearest_box(np.stack(pair)[:, None], np.ones((2, 1), np.bool_), 0) for pair in zip(first, second, strict=True)
    ]
    np.testing.assert_array_equal(contacts[:, 1], np.array(gap) == 0)


def test_touching_edges_are_not_a_contact():
    position = np.array([[[0.0, 0.0], [4.0, 0.0], [0.0, 2.0]]])
    boxes = make_boxes(position, np.zeros((1, 3)), 0.0, np.tile([4.0, 2.0, 1.5], (1, 3, 1)))
    types, present = np.ones((1, 3), np.uint8), np.ones((1, 3), np.bool_)
    assert not contacts_of(np.array([[0, 0]], np.int32), *boxes, types, present)[0].any()
