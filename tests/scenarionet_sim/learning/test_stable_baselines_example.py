"""The example of Stable-Baselines3 learns; TD3's defaults make one update for all worlds and explore nothing."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import convert

pytestmark = pytest.mark.learn
sb3 = pytest.importorskip("stable_baselines3", reason="no Stable-Baselines3: run `make test-learn`")

from stable_baselines import make_model, success_rate  # noqa: E402

from scenarionet_sim.environments.config import VectorConfig  # noqa: E402
from scenarionet_sim.environments.stable_baselines import StableBaselinesEnv  # noqa: E402
from scenarionet_sim.scenarios.selection import Scenarios  # noqa: E402

BENDS = {"blocks": "curve=1", "num_blocks": 1, "density": 0, "max_lanes": 1, "construction": 0}


@pytest.fixture(scope="module")
def env(tmp_path_factory):
    """Sixteen worlds of roads with one bend, on which a driver that goes straight on never arrives."""
    lake = tmp_path_factory.mktemp("bends") / "lake"
    convert("pg", "0:8", lake, options=BENDS | {"min_speed_limit": 10, "max_speed_limit": 10})
    made = StableBaselinesEnv(16, VectorConfig(Scenarios(lake, order="random")), seed=0, threads=1)
    yield made
    made.close()


def test_ppo_learns_to_arrive(env):
    model = make_model("ppo", env, seed=0)
    before = success_rate(model, env, 16)
    assert success_rate(model.learn(10_240), env, 32) > before + 0.3


def test_td3_with_its_defaults_makes_one_update_for_all_worlds(env):
    model = sb3.TD3("MlpPolicy", env, seed=0, device="cpu", buffer_size=2_000).learn(800)
    assert model._n_updates < 800 / 16  # of 800 transitions; the paper makes as many updates as transitions
    assert model.action_noise is None


def test_td3_of_the_example_makes_an_update_for_each_transition(env):
    model = make_model("td3", env, seed=0)
    model.learning_starts = 160
    assert model.learn(320)._n_updates == pytest.approx(160, abs=32)
    assert np.all(model.action_noise().std(axis=0) > 0.1)
