"""PPO and TD3 against Stable-Baselines3 on Pendulum-v1: returns over five seeds; a long run."""

from __future__ import annotations

from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
from scipy.stats import ttest_ind

pytestmark = [pytest.mark.learn, pytest.mark.long, pytest.mark.filterwarnings("default")]
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")
sb3 = pytest.importorskip("stable_baselines3")

from scenarionet_sim.learning.config import PpoConfig, Td3Config  # noqa: E402
from scenarionet_sim.learning.ppo import PpoLearner  # noqa: E402
from scenarionet_sim.learning.td3 import Td3Learner  # noqa: E402
from scenarionet_sim.task.scoring_kernels import NUMBERS  # noqa: E402

SEEDS, EPISODES, STEPS = range(5), 100, 200
PPO_STEPS, TD3_STEPS = 18 * 8 * 512, 7_000


class Pendulums:
    """W pendulums as rows; the first control is the torque as a share of the largest, the second is ignored."""

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


def mean_return(torque: Callable[[np.ndarray], np.ndarray]) -> float:
    """Of episodes without noise; ``torque`` maps observations (B, 3) to shares (B,) of the largest torque."""
    env, total = Pendulums(EPISODES, 1000), np.zeros(EPISODES)
    for _ in range(STEPS):
        env.step(np.repeat(torque(env.observations)[:, None], 2, axis=1))
        total += env.rewards
    return float(total.mean())


def our_return(learner, steps):
    done = 0
    while done < steps:
        done += learner.round()[0]
    return mean_return(lambda seen: learner.mode(seen)[:, 0])


def their_return(model, steps):
    model.learn(steps)
    return mean_return(lambda seen: model.predict(seen, deterministic=True)[0][:, 0] / 2.0)


def assert_means_agree(name, ours, theirs, record):
    """The 95 % interval of the difference of means (Welch) contains 0 and is narrower than 200 points."""
    low, high = ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    found = f"ours {np.round(ours, 1)}, theirs {np.round(theirs, 1)}, difference [{low:.1f}, {high:.1f}]"
    record(name, found)  # in the report of --junitxml
    assert low <= 0.0 <= high, found
    assert high - low < 200.0, found


def test_ppo_reaches_the_same_returns(record_testsuite_property):
    """8 pendulums, rounds of 512 steps, gamma 0.9, 10 passes over minibatches of 256."""
    torch.set_num_threads(1)
    config = PpoConfig(horizon=512, epochs=10, minibatch=256, rate=2e-3, gamma=0.9, hidden=(64, 64), spread=0.5)
    settings = {"n_steps": 512, "batch_size": 256, "gamma": 0.9, "learning_rate": 2e-3, "n_epochs": 10}
    ours, theirs = [], []
    for seed in SEEDS:
        ours.append(our_return(PpoLearner(Pendulums(8, seed), config, seed), PPO_STEPS))
        env = sb3.common.env_util.make_vec_env("Pendulum-v1", 8, seed=seed)
        theirs.append(their_return(sb3.PPO("MlpPolicy", env, seed=seed, device="cpu", **settings), PPO_STEPS))
    assert_means_agree("PPO", ours, theirs, record_testsuite_property)


def test_td3_reaches_the_same_returns(record_testsuite_property):
    """One pendulum, an update per step after 1,000 random ones."""
    torch.set_num_threads(1)
    config = Td3Config(horizon=1, warm_up=1_000, rate=1e-3, gamma=0.98, hidden=(128, 128), replay=20_000, worlds=1)
    noise = sb3.common.noise.NormalActionNoise(np.zeros(1), np.full(1, config.noise))
    settings = {"learning_starts": 1_000, "learning_rate": 1e-3, "gamma": 0.98, "buffer_size": 20_000}
    settings |= {"policy_kwargs": {"net_arch": [128, 128]}, "action_noise": noise, "device": "cpu"}
    ours, theirs = [], []
    for seed in SEEDS:
        ours.append(our_return(Td3Learner(Pendulums(1, seed), config, seed), TD3_STEPS))
        theirs.append(their_return(sb3.TD3("MlpPolicy", "Pendulum-v1", seed=seed, **settings), TD3_STEPS))
    assert_means_agree("TD3", ours, theirs, record_testsuite_property)
