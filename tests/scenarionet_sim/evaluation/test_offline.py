"""Offline datasets: inverse dynamics by hand, and episodes as Minari reads them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.evaluation.offline import action_towards, record_episodes
from scenarionet_sim.planners.base import Trajectory
from scenarionet_sim.scenarios.selection import Scenarios
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

LENGTH = 5.0
TIMES = 0.1 * np.arange(41)


def seen(speed=10.0, x=0.0, y=0.0, heading=0.0):
    return SimpleNamespace(ego=SimpleNamespace(x=x, y=y, heading=heading, speed=speed, length=LENGTH))


def line(speed, ahead=0.0):
    return Trajectory(np.column_stack([ahead + speed * TIMES, np.zeros((len(TIMES), 2))]), TIMES)


@pytest.mark.parametrize(
    ("trajectory", "throttle"),
    [
        (line(10.0), 0.0),
        (line(10.0, ahead=0.25), 2.0 * 0.25 / 0.5**2 / 4.0),  # 2 m/s² of the engine's 4
        (line(10.0, ahead=-0.25), -2.0 * 0.25 / 0.5**2 / 8.0),  # of the brakes' 8
        (line(20.0), 1.0),
        (line(0.0), -1.0),
    ],
)
def test_throttle_brings_it_where_the_trajectory_is_in_half_a_second(trajectory, throttle):
    assert action_towards(trajectory, seen()) == pytest.approx([0.0, throttle], abs=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_steering_is_that_of_the_circle_through_the_point(side):
    """A circle of 20 m through the rear axle: tan(steering) = wheelbase / radius."""
    radius, rear, speed = 20.0, 0.3 * LENGTH, 10.0
    angle = speed * TIMES / radius
    poses = np.column_stack([radius * np.sin(angle) - rear, side * radius * (1.0 - np.cos(angle)), side * angle])
    for x, y, heading in ((0.0, 0.0, 0.0), (100.0, -7.0, 2.0)):
        cos, sin = math.cos(heading), math.sin(heading)
        there = poses[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        steering, _ = action_towards(
            Trajectory(np.column_stack([there, poses[:, 2] + heading]), TIMES), seen(speed, x, y, heading)
        )
        wanted = side * math.atan(0.6 * LENGTH / radius) / Drive().max_steer
        assert steering == pytest.approx(wanted, rel=1e-5)


@pytest.fixture
def lake(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    drives = [make_drive(f"d{k}", speed=6.0 + k, others=(Other(40.0 + 5 * k, vx=6.0),)) for k in range(3)]
    return write_lake(tmp_path / "lake", drives)


@pytest.mark.learn
def test_the_recording_is_an_episode_that_minari_reads(lake):
    import minari

    made = record_episodes(Scenarios(lake), "drives/recorded-v0")
    dataset = minari.load_dataset("drives/recorded-v0")
    assert (len(dataset), dataset.total_steps) == (3, made.total_steps)
    env = dataset.recover_environment()
    for episode, metadata in zip(dataset, dataset.storage.get_episode_metadata(range(3)), strict=True):
        observation, _ = env.reset(seed=metadata["seed"], options=metadata["options"])
        assert np.array_equal(observation, episode.observations[0])
        for action, after, reward in zip(episode.actions, episode.observations[1:], episode.rewards, strict=True):
            observation, given, ended, late, _ = env.step(action)
            assert np.array_equal(observation, after)
            assert given == reward
        assert (ended, late) == (episode.terminations[-1], episode.truncations[-1])
        state = env.unwrapped.core.simulation.state
        row = env.unwrapped.core.simulation.batch.worlds[0].ego
        recorded = env.unwrapped.core.simulation.batch.worlds[0].log[:, row]
        now = min(int(state.timestep[0]), len(recorded) - 1)
        assert state.motion[0, row, :2] == pytest.approx(recorded[now, :2], abs=0.2)


@pytest.mark.learn
def test_an_interrupted_recording_goes_on(lake, monkeypatch):
    from scenarionet_sim.evaluation import offline

    whole = list(record_episodes(Scenarios(lake), "drives/whole-v0", "random"))
    monkeypatch.setattr(offline, "_CHUNK", 1)

    def stop(done, *_):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_episodes(Scenarios(lake), "drives/parts-v0", "random", on_progress=stop)
    begun = []
    note = lambda done, *_: begun.append(done)  # noqa: E731
    parts = record_episodes(Scenarios(lake), "drives/parts-v0", "random", on_progress=note)
    assert begun == [2, 3]
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(one.actions, other.actions)
        assert np.array_equal(one.observations, other.observations)
    with pytest.raises(BadParameter, match="choose another name or version"):
        record_episodes(Scenarios(lake), "drives/parts-v0", "random", seed=1)


@pytest.mark.learn
@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"policy": "idm"}, "moves vehicles without actions; name a planner"),
        ({"observation": "lidar"}, "choose from paper, route"),
    ],
)
def test_what_cannot_be_recorded_is_said(lake, settings, reason):
    with pytest.raises(BadParameter, match=reason):
        record_episodes(Scenarios(lake), "drives/none-v0", **settings)
