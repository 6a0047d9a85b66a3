"""Selection of bodies and transfer of their motion from and to the state, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_sim.arrays.log import HEADING, VX, YAW_RATE
from scenarionet_sim.backends.body_kernels import find_bodies, read_motion, write_motion

NUM_WORLDS, NUM_OBJECTS, DT, SLACK = 3, 40, 0.1, 0.4


@pytest.fixture
def scene() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    shape = NUM_WORLDS, NUM_OBJECTS
    motion = np.zeros((*shape, 7))
    motion[..., :2] = rng.uniform(-25, 25, (*shape, 2))
    motion[..., HEADING] = rng.uniform(-np.pi, np.pi, shape)
    motion[..., VX : VX + 2] = rng.normal(0, 8, (*shape, 2))
    motion[..., YAW_RATE] = rng.normal(0, 1, shape)
    return {"motion": motion, "size": rng.uniform(0.3, 6, (*shape, 3)), "present": rng.random(shape) < 0.8}


AGENTS = np.array([[2, 5], [0, 3], [0, 1]], np.int32)


def found(scene) -> np.ndarray:
    return find_bodies(scene["motion"], scene["size"], scene["present"], AGENTS, SLACK, DT)


def test_objects_within_reach_become_bodies(scene):
    position, velocity = scene["motion"][..., :2], scene["motion"][..., VX : VX + 2]
    radius = 0.5 * np.hypot(scene["size"][..., 0], scene["size"][..., 1])
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    near = np.zeros(scene["present"].shape, bool)
    for world, row in AGENTS:
        gap = np.linalg.norm(position[world] - position[world, row], axis=1)
        reach = radius[world] + radius[world, row] + (speed[world] + speed[world, row] + SLACK) * DT
        near[world] |= gap <= reach
    near &= scene["present"]
    near[AGENTS[:, 0], AGENTS[:, 1]] = False
    rows = found(scene)
    np.testing.assert_array_equal(rows[: len(AGENTS)], AGENTS)
    np.testing.assert_array_equal(rows[len(AGENTS) :], np.argwhere(near))
    assert 0 < near.sum() < near.size - 20


def test_other_bodies_start_one_step_back(scene):
    rows = found(scene)
    bodies = read_motion(scene["motion"], rows, len(AGENTS), DT)
    motion = scene["motion"][rows[:, 0], rows[:, 1]]
    before = np.where(np.arange(len(rows)) < len(AGENTS), 0.0, DT)
    np.testing.assert_allclose(bodies[:, :2], motion[:, :2] - motion[:, VX : VX + 2] * before[:, None])
    np.testing.assert_allclose(bodies[:, 2], motion[:, HEADING] - motion[:, YAW_RATE] * before)
    np.testing.assert_array_equal(bodies[:, 3:5], motion[:, VX : VX + 2])
    np.testing.assert_array_equal(bodies[:, 5], motion[:, YAW_RATE])


def test_agents_are_written_back_with_wrapped_headings(scene):
    bodies = np.random.default_rng(1).normal(0, 9, (len(AGENTS), 6))
    motion, before, at = scene["motion"], scene["motion"].copy(), (AGENTS[:, 0], AGENTS[:, 1])
    write_motion(motion, AGENTS, bodies.copy())
    np.testing.assert_array_equal(motion[at][:, :2], bodies[:, :2])
    np.testing.assert_allclose(motion[at][:, HEADING], wrap_angle(bodies[:, 2]), atol=1e-12)
    np.testing.assert_array_equal(motion[at][:, VX : VX + 2], bodies[:, 3:5])
    np.testing.assert_array_equal(motion[at][:, YAW_RATE], bodies[:, 5])
    is_other = np.ones(before.shape[:2], bool)
    is_other[at] = False
    np.testing.assert_array_equal(motion[is_other], before[is_other])
