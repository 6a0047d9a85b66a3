"""Proximal policy optimization on the vector environment, in one file and NumPy.

    OPENBLAS_NUM_THREADS=1 python -m scenarionet_sim.examples.ppo lake busy_train --steps 100000

(The matrices are too small to benefit from several threads.)

The algorithm is Schulman et al. (2017) with generalized advantage estimation, in the order of CleanRL's single file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click
import numpy as np
from gymnasium.spaces import flatdim

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.examples.network import Adam, Perceptron

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Ppo:
    """Hyperparameters of PPO.

    Attributes:
        horizon: Steps per world between two updates.
        epochs, minibatches: Passes over the collected steps per update, and minibatches per pass.
        gamma, smoothing: Discount, and the lambda of the advantages.
        clip: Clipping range of the probability ratio.
        rate: Learning rate.
        entropy: Weight of the entropy bonus.
        reward_scale: Factor of the rewards, so that returns are near 1.
        hidden: Width of the two hidden layers.
    """

    horizon: int = 64
    epochs: int = 6
    minibatches: int = 8
    gamma: float = 0.99
    smoothing: float = 0.95
    clip: float = 0.2
    rate: float = 1e-3
    entropy: float = 1e-3
    reward_scale: float = 0.05
    hidden: int = 64


@dataclass(frozen=True, eq=False)
class Experience:
    """Experience of W worlds in H steps, (H, W, ...); (H * W, ...) after :meth:`flat`."""

    observations: Float64
    actions: Float64
    log_probabilities: Float64
    advantages: Float64
    returns: Float64

    def flat(self) -> Experience:
        """Merge the axes of steps and worlds."""
        arrays = (values.reshape(-1, *values.shape[2:]) for values in vars(self).values())
        return Experience(*arrays)

    def take(self, rows: np.ndarray) -> Experience:
        """Return some rows."""
        return Experience(*(values[rows] for values in vars(self).values()))


class Learner:
    """PPO with a Gaussian policy and a value function.

    Args:
        envs: Environment with ``AutoresetMode.SAME_STEP``, flat observations and actions in [-1, 1].
        options: Hyperparameters.
        seed: Seed of weights, actions and scenarios.
    """

    def __init__(self, envs: VectorEnv, options: Ppo = Ppo(), seed: int = 0) -> None:
        self._envs, self._options = envs, options
        self._rng = np.random.default_rng(seed)
        inputs, outputs = flatdim(envs.single_observation_space), flatdim(envs.single_action_space)
        hidden = [options.hidden] * 2
        self.actor = Perceptron([inputs, *hidden, outputs], self._rng, last=0.01)
        self.critic = Perceptron([inputs, *hidden, 1], self._rng, last=1.0)
        self.log_std = np.full(outputs, -0.5)
        parameters = [*self.actor.parameters, self.log_std, *self.critic.parameters]
        self._adam = Adam(parameters, options.rate)
        self._observation = envs.reset(seed=seed)[0]
        self._episode_return = np.zeros(envs.num_envs)

    def train(self, steps: int) -> Iterator[tuple[int, float]]:
        """Train for about ``steps`` world steps.

        Yields:
            After each update: steps so far, and the mean return of the episodes that ended since (NaN for none).
        """
        a_round = self._options.horizon * self._envs.num_envs
        for done in range(a_round, steps + a_round, a_round):
            experience, finished = self._collect()
            self._update(experience)
            yield done, float(np.mean(finished)) if finished else float("nan")

    def act(self, observations: Float64) -> Float64:
        """Return the mode of the action distribution (B, 2)."""
        return np.clip(self.actor(observations), -1.0, 1.0)

    def _collect(self) -> tuple[Experience, list[float]]:
        """Collect H steps, and the returns of the episodes that ended in them."""
        seen, acts, logs, values, rewards, ends, finished = [], [], [], [], [], [], []
        for _ in range(self._options.horizon):  # sequential by nature
            seen.append(np.asarray(self._observation, np.float64))
            mean = self.actor(seen[-1])
            acts.append(mean + np.exp(self.log_std) * self._rng.normal(size=mean.shape))
            logs.append(self._log_probability(acts[-1], mean))
            values.append(self.critic(seen[-1])[:, 0])
            clipped = np.clip(acts[-1], -1.0, 1.0).astype(np.float32)
            self._observation, reward, terminated, truncated, _ = self._envs.step(clipped)
            rewards.append(reward * self._options.reward_scale)
            ends.append(terminated | truncated)
            self._episode_return += reward
            finished += self._episode_return[ends[-1]].tolist()
            self._episode_return[ends[-1]] = 0.0
        values.append(self.critic(np.asarray(self._observation, np.float64))[:, 0])
        advantages = self._advantages(np.array(rewards), np.array(values), np.array(ends))
        arrays = np.array(seen), np.array(acts), np.array(logs), advantages, advantages + np.array(values[:-1])
        return Experience(*arrays), finished

    def _advantages(self, rewards: Float64, values: Float64, ends: np.ndarray) -> Float64:
        """Return generalized advantage estimates (H, W) from (H, W) rewards, (H + 1, W) values, (H, W) episode ends."""
        discount, found, last = self._options.gamma, np.zeros_like(rewards), np.zeros(rewards.shape[1])
        goes_on = 1.0 - ends
        surprise = rewards + discount * values[1:] * goes_on - values[:-1]
        for step in reversed(range(len(rewards))):  # backward recursion
            last = surprise[step] + discount * self._options.smoothing * goes_on[step] * last
            found[step] = last
        return found

    def _update(self, experience: Experience) -> None:
        rows = experience.flat()
        for _ in range(self._options.epochs):
            for part in np.array_split(self._rng.permutation(len(rows.returns)), self._options.minibatches):
                self._adam.step(self.gradients(rows.take(part)))

    def gradients(self, batch: Experience) -> list[Float64]:
        """Return the gradients of the loss of a batch by all parameters."""
        count, std = len(batch.returns), np.exp(self.log_std)
        actor, critic = self.actor.forward(batch.observations), self.critic.forward(batch.observations)
        apart = (batch.actions - actor[-1]) / std
        ratio = np.exp(self._log_probability(batch.actions, actor[-1]) - batch.log_probabilities)
        is_held = np.where(batch.advantages > 0, ratio < 1 + self._options.clip, ratio > 1 - self._options.clip)
        by_log = (-batch.advantages * ratio * is_held / count)[:, None]
        by_log_std = (by_log * (apart**2 - 1.0)).sum(axis=0) - self._options.entropy
        by_value = (critic[-1][:, 0] - batch.returns)[:, None] / count
        return [
            *self.actor.backward(actor, by_log * apart / std),
            by_log_std,
            *self.critic.backward(critic, by_value),
        ]

    def loss(self, batch: Experience) -> float:
        """Return the loss whose gradient is :meth:`gradients`."""
        mean, value = self.actor(batch.observations), self.critic(batch.observations)[:, 0]
        ratio = np.exp(self._log_probability(batch.actions, mean) - batch.log_probabilities)
        held = np.clip(ratio, 1 - self._options.clip, 1 + self._options.clip)
        policy = -np.minimum(ratio * batch.advantages, held * batch.advantages).mean()
        return float(policy + 0.5 * ((value - batch.returns) ** 2).mean() - self._options.entropy * self.log_std.sum())

    def _log_probability(self, actions: Float64, mean: Float64) -> Float64:
        apart = (actions - mean) / np.exp(self.log_std)
        total: Float64 = (-0.5 * apart**2 - self.log_std - 0.5 * _LOG_2PI).sum(axis=-1)
        return total


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("database", required=False)
@click.option("--steps", default=100_000, show_default=True, help="Steps of a world to learn for.")
@click.option("--worlds", default=16, show_default=True, help="Worlds that step together.")
@click.option("--seed", default=0, show_default=True)
def main(lake: str, database: str | None, steps: int, worlds: int, seed: int) -> None:
    """Learn, and print the mean reward of episodes as it rises."""
    from scenarionet_sim import ScenarioNetVectorEnv, Scenarios

    envs = ScenarioNetVectorEnv(worlds, scenarios=Scenarios(lake, database, order="random"), autoreset_mode="SameStep")
    for done, reward in Learner(envs, seed=seed).train(steps):
        click.echo(f"{done:>9,} steps  reward of an episode {reward:8.2f}")
    envs.close()


if __name__ == "__main__":
    main()
