"""Which objects become bodies, and their motion out of and into the state, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_sim.kernels.bodies import find_bodies, read_motion, write_motion

NUM_WORLDS, NUM_OBJECTS, DT, SLACK = 3, 40, 0.1, 0.4


@pytest.fixture
def scene() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    shape = NUM_WORLDS, NUM_OBJECTS
    return {
        "position": rng.uniform(-25, 25, (*shape, 2)),
        "heading": rng.uniform(-np.pi, np.pi, shape),
        "velocity": rng.normal(0, 8, (*shape, 2)),
        "yaw_rate": rng.normal(0, 1, shape),
        "size": rng.uniform(0.3, 6, (*shape, 3)),
        "present": rng.random(shape) < 0.8,
    }


AGENTS = np.array([[2, 5], [0, 3], [0, 1]], np.int32)


def found(scene) -> np.ndarray:
    names = ("position", "velocity", "size", "present")
    return find_bodies(*(scene[name] for name in names), AGENTS, SLACK, DT)


def test_finds_what_may_be_touched(scene):
    radius = 0.5 * np.hypot(scene["size"][..., 0], scene["size"][..., 1])
    speed = np.hypot(scene["velocity"][..., 0], scene["velocity"][..., 1])
    near = np.zeros(scene["present"].shape, bool)
    for world, row in AGENTS:
        gap = np.linalg.norm(scene["position"][world] - scene["position"][world, row], axis=1)
        reach = radius[world] + radius[world, row] + (speed[world] + speed[world, row] + SLACK) * DT
        near[world] |= gap <= reach
    near &= scene["present"]
    near[AGENTS[:, 0], AGENTS[:, 1]] = False
    rows = found(scene)
    np.testing.assert_array_equal(rows[: len(AGENTS)], AGENTS)
    np.testing.assert_array_equal(rows[len(AGENTS) :], np.argwhere(near))
    assert 0 < near.sum() < near.size - 20


def test_others_start_where_their_motion_had_them(scene):
    rows = found(scene)
    motion = read_motion(
        scene["position"], scene["heading"], scene["velocity"], scene["yaw_rate"], rows, len(AGENTS), DT
    )
    at = rows[:, 0], rows[:, 1]
    before = np.where(np.arange(len(rows)) < len(AGENTS), 0.0, DT)
    np.testing.assert_allclose(motion[:, :2], scene["position"][at] - scene["velocity"][at] * before[:, None])
    np.testing.assert_allclose(motion[:, 2], scene["heading"][at] - scene["yaw_rate"][at] * before)
    np.testing.assert_array_equal(motion[:, 3:5], scene["velocity"][at])
    np.testing.assert_array_equal(motion[:, 5], scene["yaw_rate"][at])


def test_agents_are_written_back_with_wrapped_headings(scene):
    motion = np.random.default_rng(1).normal(0, 9, (len(AGENTS), 6))
    names, before = ("position", "heading", "velocity", "yaw_rate"), {k: v.copy() for k, v in scene.items()}
    write_motion(*(scene[name] for name in names), AGENTS, motion)
    at = AGENTS[:, 0], AGENTS[:, 1]
    np.testing.assert_array_equal(scene["position"][at], motion[:, :2])
    np.testing.assert_allclose(scene["heading"][at], wrap_angle(motion[:, 2]), atol=1e-12)
    np.testing.assert_array_equal(scene["velocity"][at], motion[:, 3:5])
    np.testing.assert_array_equal(scene["yaw_rate"][at], motion[:, 5])
    is_other = np.ones(before["heading"].shape, bool)
    is_other[at] = False
    for name in names:
        np.testing.assert_array_equal(scene[name][is_other], before[name][is_other])
