"""Traffic: car-following law, collisions, lights, determinism, and kernels against plain Python."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays import idm
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.procedural.generate import generate, make_lights
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.population import boxes
from scenarionet_data.procedural.right_of_way import GO, STOP

OPTIONS = GeneratorOptions()
speeds = st.floats(0.0, 30.0)


@kernel
def interaction(speed, gap, closing, headway, accel, decel, standstill):
    return idm.interaction(speed, gap, closing, headway, accel, decel, standstill)


@kernel
def free_acceleration(speed, desired, accel, decel):
    return idm.free_acceleration(speed, desired, accel, decel)


@kernel
def is_worth_changing(own_gain, follower_loss, politeness, threshold):
    return idm.is_worth_changing(own_gain, follower_loss, politeness, threshold)


@given(speeds, st.floats(0.5, 100.0), speeds)
def test_interaction_is_the_intelligent_driver_model(speed, gap, leader):
    wanted = 2.0 + max(0.0, 1.5 * speed + speed * (speed - leader) / (2 * (1.4 * 2.0) ** 0.5))
    arguments = (speed, gap, speed - leader, 1.5, 1.4, 2.0, 2.0)
    assert interaction(*arguments) == pytest.approx(1.4 * (wanted / gap) ** 2)
    assert interaction(*arguments) == pytest.approx(idm.interaction.py_func(*arguments))


@pytest.mark.parametrize("speed", [0.0, 5.0, 12.0])
def test_equilibrium_gap(speed):
    desired, headway, accel, standstill = 15.0, 1.5, 1.4, 2.0
    gap = (standstill + headway * speed) / (1 - (speed / desired) ** 4) ** 0.5
    braking = interaction(speed, gap, 0.0, headway, accel, 2.0, standstill)
    assert free_acceleration(speed, desired, accel, 2.0) - braking == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        ((10.0, 20.0, 2.0), 1.944872),  # 2 + 15 + 20 / (2 sqrt 3) = 22.7735 m wanted: 1.5 (22.7735 / 20)^2
        ((10.0, 20.0, -10.0), 0.015),  # the leader pulls away: 2 m wanted
        ((0.0, 4.0, 0.0), 0.375),
        ((0.0, 0.0, 0.0), 600.0),  # a gap of 0 counts as 0.1 m
    ],
)
def test_interaction_by_hand(arguments, wanted):
    assert interaction(*arguments, 1.5, 1.5, 2.0, 2.0) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("speed", "wanted"), [(0.0, 1.5), (10.0, 1.40625), (20.0, 0.0), (22.0, -0.69615), (30.0, -2.0)]
)
def test_free_acceleration_by_hand(speed, wanted):
    assert free_acceleration(speed, 20.0, 1.5, 2.0) == pytest.approx(wanted, abs=1e-9)


def test_lane_change_must_outweigh_its_cost_to_others():
    assert is_worth_changing(1.0, 1.0, 0.5, 0.3)
    assert not is_worth_changing(1.0, 2.0, 0.5, 0.3)
    assert not is_worth_changing(1.0, 1.5, 0.5, 0.25)  # equal to the threshold
    assert is_worth_changing(0.5, -1.0, 0.5, 0.9)  # the new follower gains


def test_lights_of_one_junction_are_never_green_together():
    lights = make_lights([(1, 0), (1, 1)], 1000, 0.1, np.random.default_rng(3))
    assert set(np.unique(lights)) == {1, 2, 3}
    assert (lights != STOP).sum(axis=0).max() == 1
    turned_red = (lights[:, 1:] == STOP) & (lights[:, :-1] == GO)
    assert not turned_red.any(), "yellow comes between green and red"


def test_equal_seeds_are_bit_identical():
    first, second = generate(5, OPTIONS), generate(5, OPTIONS)
    assert np.array_equal(first.motion, second.motion)
    assert np.array_equal(first.lights, second.lights)
    assert not np.array_equal(first.motion[:1, :5], generate(6, OPTIONS).motion[:1, :5])


@pytest.mark.long
def test_kernels_match_plain_python():
    """The same seed with compilation disabled, in a separate process."""
    code = (
        "import json, sys\n"
        "from scenarionet_data.procedural.generate import generate\n"
        "from scenarionet_data.procedural.options import GeneratorOptions\n"
        "print(json.dumps(generate(8, GeneratorOptions(max_steps=60)).motion.tolist()))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    compiled = generate(8, GeneratorOptions(max_steps=60)).motion
    np.testing.assert_allclose(np.array(json.loads(result.stdout)), compiled, atol=1e-6)


def touches(episode):
    """Pairs (vehicle, other) whose boxes overlap at any timestep, by the separating axis theorem."""
    poses, sizes = boxes(episode.obstacles)
    steps = episode.motion.shape[1]
    position = np.concatenate([episode.motion[..., :2], np.repeat(poses[:, None, :2], steps, axis=1)])
    heading = np.concatenate([episode.motion[..., 2], np.repeat(poses[:, None, 2], steps, axis=1)])
    size = np.concatenate([episode.population.size, sizes])[:, None]
    valid = np.concatenate([episode.valid, np.ones((len(poses), steps), bool)])
    corners = box_corners(position, heading, *(np.broadcast_to(size[..., k], heading.shape) for k in (0, 1)))
    axes = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    sides = np.stack([-axes[..., 1], axes[..., 0]], axis=-1)
    found = set()
    for i in range(len(episode.motion)):
        for j in range(i + 1, len(position)):
            apart = ~(valid[i] & valid[j])
            for axis in (axes[i], sides[i], axes[j], sides[j]):
                a, b = (np.einsum("tkd,td->tk", corners[row], axis) for row in (i, j))
                apart |= (a.max(axis=1) < b.min(axis=1)) | (b.max(axis=1) < a.min(axis=1))
            if not apart.all():
                found.add((i, j))
    return found


def runs_red(episode):
    """Vehicles that enter a lane in an intersection while its light is red."""
    found = set()
    for lane in np.flatnonzero(episode.graph.lanes.signal >= 0):
        pose = episode.road_map.lanes[lane].path.start
        ahead = (episode.motion[..., 0] - pose.x) * np.cos(pose.heading)
        ahead += (episode.motion[..., 1] - pose.y) * np.sin(pose.heading)
        beside = np.abs(
            (episode.motion[..., 1] - pose.y) * np.cos(pose.heading)
            - (episode.motion[..., 0] - pose.x) * np.sin(pose.heading)
        )
        crossing = (ahead[:, 1:] >= 0) & (ahead[:, :-1] < 0) & (beside[:, 1:] < 1.0) & (ahead[:, 1:] < 3.0)
        crossing &= episode.valid[:, 1:] & episode.valid[:, :-1]
        red = episode.lights[episode.graph.lanes.signal[lane], 1:] == STOP
        found |= set(np.flatnonzero((crossing & red).any(axis=1)))
    return found


@pytest.mark.long
def test_vehicles_keep_apart_and_stop_at_red():
    episodes = [generate(seed, OPTIONS) for seed in range(40)]
    assert sum(bool(touches(episode)) for episode in episodes) <= 1
    assert sum(bool(runs_red(episode)) for episode in episodes) <= 1
    assert sum((episode.graph.lanes.signal >= 0).any() for episode in episodes) > 3, "no lights seen"
    assert sum(bool(episode.obstacles) for episode in episodes) > 5, "no road works seen"


@pytest.mark.parametrize(("version", "share"), [("v1", 0.95), ("v2", 0.85)])  # the others wait for more than 90 s
def test_lanes_are_changed_and_the_ego_reaches_its_goal(version, share):
    episodes = [generate(seed, GeneratorOptions(version=version)) for seed in range(40)]
    arrived = [episode.motion.shape[1] < OPTIONS.max_steps for episode in episodes]
    assert np.mean(arrived) > share
    steer = [np.abs(np.diff(episode.motion[0, :, 2])).sum() for episode in episodes]
    assert np.mean(np.array(steer) > 0.05) > 0.5


@pytest.mark.parametrize("density", [0.0, 15.0])
def test_density_scales_traffic(density):
    episode = generate(1, GeneratorOptions(density=density, pedestrians=0.0, max_steps=50))
    count = len(episode.population.kinds)
    assert count == 1 if density == 0.0 else count > 40


@pytest.mark.long
def test_road_works_close_a_lane_and_traffic_passes():
    closed = [
        e for e in (generate(seed, OPTIONS) for seed in range(60)) if np.isfinite(e.graph.lanes.closed_from).any()
    ]
    assert len(closed) >= 3
    for episode in closed:
        assert any(obstacle.word == "barrier" for obstacle in episode.obstacles)
        assert episode.motion.shape[1] < OPTIONS.max_steps
        assert not any(j >= len(episode.motion) for _, j in touches(episode))


@pytest.mark.long
def test_thousand_seeds_without_collisions():
    touching = [seed for seed in range(1000) if touches(generate(seed, OPTIONS))]
    assert len(touching) <= 10, touching
