"""The example of Stable-Baselines3 learns, and TD3's defaults make hardly any updates in a batch of worlds."""

from __future__ import annotations

import pytest

pytestmark = pytest.mark.learn
sb3 = pytest.importorskip("stable_baselines3", reason="no Stable-Baselines3: run `make test-learn`")

from scenarionet_sim.environments.config import VectorConfig  # noqa: E402
from scenarionet_sim.environments.stable_baselines import StableBaselinesEnv  # noqa: E402
from scenarionet_sim.examples.stable_baselines import make_model, success_rate  # noqa: E402


@pytest.fixture
def env(only):
    made = StableBaselinesEnv(16, VectorConfig(only("empty", "crowd", "walker")), seed=0, threads=1)
    yield made
    made.close()


def test_ppo_learns_to_arrive(env):
    model = make_model("ppo", env, seed=0)
    before = success_rate(model, env, 16)
    assert success_rate(model.learn(16_384), env, 32) > max(before, 0.8)


def test_td3_with_its_defaults_makes_one_update_for_all_worlds(env):
    model = sb3.TD3("MlpPolicy", env, seed=0, device="cpu", buffer_size=2_000).learn(800)
    assert model._n_updates < 800 / 16  # of 800 transitions; the paper makes as many updates as transitions
    assert model.action_noise is None


def test_td3_of_the_example_makes_an_update_for_each_transition(env):
    model = make_model("td3", env, seed=0)
    model.learning_starts = 160
    assert model.learn(320)._n_updates == pytest.approx(160, abs=32)
    assert model.action_noise is not None
