"""The PPO example: its gradients, its advantages, and that it learns."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from scenarionet_sim.examples.ppo import Experience, Learner, Ppo


class Target(gymnasium.Env):
    """Ten steps; each is rewarded for returning the two observed numbers."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._left, self._seen = 10, self.np_random.uniform(-0.8, 0.8, 2).astype(np.float32)
        return self._seen.copy(), {}

    def step(self, action):
        reward = 1.0 - float(np.abs(action - self._seen).sum())
        self._left -= 1
        self._seen = self.np_random.uniform(-0.8, 0.8, 2).astype(np.float32)
        return self._seen.copy(), reward, self._left == 0, False, {}


def learner(**options):
    envs = SyncVectorEnv([Target] * 8, autoreset_mode=AutoresetMode.SAME_STEP)
    return Learner(envs, Ppo(**options), seed=1)


def test_gradients_match_the_loss():
    made, rng = learner(hidden=5), np.random.default_rng(0)
    shapes = ((40, 2), (40, 2), (40,), (40,), (40,))
    batch = Experience(*(rng.normal(size=shape) for shape in shapes))
    mean = made.actor(batch.observations)
    near = made._log_probability(batch.actions, mean) + 0.3 * batch.log_probabilities  # some are clipped
    batch = Experience(batch.observations, batch.actions, near, batch.advantages, batch.returns)
    parameters = [*made.actor.parameters, made.log_std, *made.critic.parameters]
    for values, gradient in zip(parameters, made.gradients(batch), strict=True):
        assert gradient.shape == values.shape
        for place in list(np.ndindex(values.shape))[:6]:
            before, around = values[place], []
            for step in (1e-6, -1e-6):
                values[place] = before + step
                around.append(made.loss(batch))
            values[place] = before
            assert gradient[place] == pytest.approx((around[0] - around[1]) / 2e-6, abs=1e-6)


def test_advantages_of_two_steps():
    """Two steps of one world, gamma 0.5, lambda 0.5; then the same with an episode end between them."""
    made = learner(gamma=0.5, smoothing=0.5)
    rewards, values = np.array([[1.0], [2.0]]), np.array([[3.0], [4.0], [6.0]])
    # TD errors: 1 + 0.5 * 4 - 3 = 0 and 2 + 0.5 * 6 - 4 = 1
    assert made._advantages(rewards, values, np.zeros((2, 1), bool)).tolist() == [[0.25], [1.0]]
    # TD error of the first: 1 - 3 = -2, and nothing comes after it
    assert made._advantages(rewards, values, np.array([[True], [False]])).tolist() == [[-2.0], [1.0]]


@pytest.mark.long
def test_ppo_learns_the_target():
    made = learner(horizon=32, rate=5e-3, reward_scale=0.2)
    curve = [reward for _, reward in made.train(8 * 32 * 25)]
    assert np.mean(curve[-3:]) > np.mean(curve[:3]) + 3.0
    seen = np.array([[0.5, -0.5], [-0.3, 0.2]])
    assert made.act(seen) == pytest.approx(seen, abs=0.25)
