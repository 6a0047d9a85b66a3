"""Real recordings, where they are at hand: every one can be replayed to success, and driven by several agents."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.conversion import convert
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.policies import Replay
from scenarionet_sim.scenarios import Scenarios


@pytest.fixture(scope="module")
def pickled(recordings, tmp_path_factory):
    lake = tmp_path_factory.mktemp("recorded") / "lake"
    convert("scenarionet", str(recordings / "scenarionet"), lake)
    return Scenarios(lake)


@pytest.mark.parametrize("backend", [Kinematic(), Bullet()], ids=["kinematic", "bullet"])
def test_every_recording_replays_to_success(pickled, backend):
    env = ScenarioNetEnv(scenarios=pickled, policies=(Replay(),), backend=backend)
    for _ in range(len(env)):
        env.reset()
        is_over = False
        while not is_over:
            _, _, terminated, truncated, info = env.step((0.0, 0.0))
            assert info["distance_to_log"] < 1e-5
            is_over = terminated or truncated
        assert info["success"], info["scenario_id"]


@pytest.mark.parametrize("backend", [Kinematic(), Bullet()], ids=["kinematic", "bullet"])
def test_every_vehicle_of_a_recording_is_an_agent(pickled, backend):
    env, most = ScenarioNetParallelEnv(scenarios=pickled, backend=backend), 0
    for _ in range(14):
        env.reset()
        most = max(most, len(env.agents))
        for _ in range(10):
            if env.agents:
                _, rewards, *_ = env.step(dict.fromkeys(env.agents, (0.0, 0.05)))
                assert np.isfinite(list(rewards.values())).all()
    assert most >= 20
