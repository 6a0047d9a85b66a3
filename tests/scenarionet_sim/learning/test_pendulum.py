"""PPO and TD3 against Stable-Baselines3 on Pendulum-v1: returns over five seeds; a long run."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

pytestmark = [pytest.mark.learn, pytest.mark.long, pytest.mark.filterwarnings("default")]
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")
sb3 = pytest.importorskip("stable_baselines3")

from scenarionet_sim.kernels.scoring import NUMBERS  # noqa: E402
from scenarionet_sim.learning.config import PpoConfig, Td3Config  # noqa: E402
from scenarionet_sim.learning.experiments.statistics import bootstrap  # noqa: E402
from scenarionet_sim.learning.ppo import PpoLearner  # noqa: E402
from scenarionet_sim.learning.td3 import Td3Learner  # noqa: E402

SEEDS, TESTS = range(5), 20


class Pendulums:
    """W pendulums as rows; the first control is the torque as a share of the largest."""

    def __init__(self, count, seed):
        options = {"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP}
        self._envs = gymnasium.make_vec("Pendulum-v1", count, vectorization_mode="sync", vector_kwargs=options)
        self.num_agents, self.masks = count, np.ones(count, np.bool_)
        self.observations = self._envs.reset(seed=seed)[0].astype(np.float32)
        self.last_observations = np.zeros_like(self.observations)
        self.last_numbers = np.zeros((count, len(NUMBERS)))
        self.rewards = np.zeros(count, np.float32)
        self.terminals, self.truncations, self.arrivals = np.zeros((3, count), np.bool_)

    def step(self, actions):
        seen, rewards, _, self.truncations, infos = self._envs.step(2.0 * np.clip(actions[:, :1], -1, 1))
        self.observations, self.rewards = seen.astype(np.float32), rewards.astype(np.float32)
        for row in np.flatnonzero(self.truncations):
            self.last_observations[row] = infos["final_obs"][row]


def tested(act):
    """Mean return of episodes without noise; ``act`` maps observations (B, 3) to shares of the torque (B,)."""
    env = Pendulums(TESTS, 1000)
    total = np.zeros(TESTS)
    for _ in range(200):
        env.step(np.stack([act(env.observations)] * 2, axis=1))
        total += env.rewards
    return total.mean()


def ours(learner, steps):
    done = 0
    while done < steps:
        done += learner.round()[0]
    return tested(lambda seen: learner.mode(seen)[:, 0])


def compare(mine, theirs):
    difference = bootstrap(np.subtract(mine, theirs))
    assert difference.low <= 0.0 <= difference.high, (mine, theirs, difference)
    assert difference.high - difference.low < 200.0, (mine, theirs, difference)


def test_ppo_reaches_the_same_returns():
    """8 pendulums, rounds of 512 steps, gamma 0.9, 10 passes over minibatches of 256; flat after 65,000 steps."""
    torch.set_num_threads(1)
    steps = 18 * 8 * 512
    config = PpoConfig(horizon=512, epochs=10, minibatch=256, rate=2e-3, gamma=0.9, hidden=(64, 64), spread=0.5)
    mine = [ours(PpoLearner(Pendulums(8, seed), config, seed), steps) for seed in SEEDS]
    theirs = []
    for seed in SEEDS:
        env = sb3.common.env_util.make_vec_env("Pendulum-v1", 8, seed=seed)
        settings = {"n_steps": 512, "batch_size": 256, "gamma": 0.9, "learning_rate": 2e-3, "n_epochs": 10}
        model = sb3.PPO("MlpPolicy", env, seed=seed, device="cpu", **settings).learn(steps)
        theirs.append(tested(lambda seen, model=model: model.predict(seen, deterministic=True)[0][:, 0] / 2.0))
    compare(mine, theirs)


def test_td3_reaches_the_same_returns():
    """One pendulum, an update per step, 7,000 steps."""
    torch.set_num_threads(1)
    config = Td3Config(horizon=1, warm_up=1_000, rate=1e-3, gamma=0.98, hidden=(128, 128), replay=20_000, worlds=1)
    mine = [ours(Td3Learner(Pendulums(1, seed), config, seed), 7_000) for seed in SEEDS]
    theirs = []
    for seed in SEEDS:
        noise = sb3.common.noise.NormalActionNoise(np.zeros(1), np.full(1, 0.1))
        settings = {"learning_starts": 1_000, "learning_rate": 1e-3, "gamma": 0.98, "buffer_size": 20_000}
        settings |= {"policy_kwargs": {"net_arch": [128, 128]}, "action_noise": noise, "device": "cpu"}
        model = sb3.TD3("MlpPolicy", "Pendulum-v1", seed=seed, **settings).learn(7_000)
        theirs.append(tested(lambda seen, model=model: model.predict(seen, deterministic=True)[0][:, 0] / 2.0))
    compare(mine, theirs)
