"""The Stable-Baselines3 environment, with that package's base class or, where it is not installed, a stand-in."""

from __future__ import annotations

import importlib
import sys
from importlib.util import find_spec
from types import ModuleType

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.config import VectorConfig
from scenarionet_sim.environments.flat import FlatEnv

MODULE = "scenarionet_sim.environments.stable_baselines"


class StandIn:
    """The part of ``VecEnv`` that subclasses inherit."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()

    def _get_indices(self, indices):
        return range(self.num_envs) if indices is None else [indices] if isinstance(indices, int) else indices


@pytest.fixture
def environment(monkeypatch):
    if find_spec("stable_baselines3") is None:
        package = ModuleType("stable_baselines3.common.vec_env")
        package.VecEnv = StandIn
        for name in ("stable_baselines3", "stable_baselines3.common"):
            monkeypatch.setitem(sys.modules, name, ModuleType(name))
        monkeypatch.setitem(sys.modules, package.__name__, package)
    monkeypatch.delitem(sys.modules, MODULE, raising=False)
    yield importlib.import_module(MODULE).StableBaselinesEnv
    sys.modules.pop(MODULE, None)


def test_episodes_are_those_of_the_flat_environment(environment, only):
    config = VectorConfig(only("wall", "empty"), prefetch=0)
    env, flat = environment(2, config, seed=1), FlatEnv(2, config, seed=1)
    env.seed(3)
    np.testing.assert_array_equal(env.reset(), flat.reset(seed=3)[0])
    before, ended = env.reset(), 0
    flat.reset()
    for _ in range(60):
        actions = np.tile([0.0, 0.6], (2, 1))
        seen, rewards, dones, infos = env.step(actions)
        flat.step(actions)
        np.testing.assert_array_equal(seen, flat.observations)
        np.testing.assert_array_equal(rewards, flat.rewards)
        np.testing.assert_array_equal(dones, flat.terminals | flat.truncations)
        assert seen is not before
        for slot in np.flatnonzero(dones):
            np.testing.assert_array_equal(infos[slot]["terminal_observation"], flat.last_observations[slot])
            assert infos[slot]["TimeLimit.truncated"] == flat.truncations[slot]
            ended += 1
    assert ended
    assert env.get_attr("render_mode") == [None, None] and env.env_is_wrapped(object, indices=1) == [False]
    with pytest.raises(BadParameter, match="cannot differ"):
        env.set_attr("seats", 2)
    env.close()
    flat.close()
