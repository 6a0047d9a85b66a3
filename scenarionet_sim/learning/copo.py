"""Coordinated policy optimization (Peng et al. 2021): agents weigh their own rewards against those of their neighbours.

Each agent draws an angle phi from a normal distribution, the local coordination factor, and follows the advantage
``cos(phi) A_own + sin(phi) A_neighbourhood``; the distribution learns by a meta-gradient from the rewards of all.
Without an angle (its mean and deviation frozen at 0) it is independent PPO, to the bit.
"""

from __future__ import annotations

import math
from copy import deepcopy
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_sim.learning.config import CopoConfig
from scenarionet_sim.learning.descent import Descent
from scenarionet_sim.learning.networks import StochasticPolicy, perceptron
from scenarionet_sim.learning.ppo import Batch, PpoLearner, standardized, surrogate
from scenarionet_sim.learning.rollout import RolloutBuffer, neighbour_rewards
from scenarionet_sim.learning.rows import AgentRows

_SMALLEST_DEVIATION = 1e-4


class SocialAdvantages(NamedTuple):
    """Advantages (B,) of B steps of agents, before standardization except the global one."""

    own: Tensor
    neighbour: Tensor
    all: Tensor


def coordinated(own: Tensor, neighbour: Tensor, angle: Tensor) -> Tensor:
    """Return the advantages (B,) that agents with angles (B,) follow, in units of 90 degrees."""
    return torch.cos(angle * (math.pi / 2)) * own + torch.sin(angle * (math.pi / 2)) * neighbour


class AngleDistribution(nn.Module):
    """Normal distribution of the angle, in units of 90 degrees.

    Attributes:
        parameters_: (2,) the inverse hyperbolic tangent of the mean, and the logarithm of the deviation.
    """

    def __init__(self, spread: float) -> None:
        super().__init__()
        self.parameters_ = nn.Parameter(torch.tensor([0.0, math.log(spread) if spread else -20.0]))
        self._is_fixed = not spread

    def draw(self, noise: Tensor) -> Tensor:
        """Return the angles for standard normal noise; differentiable."""
        if self._is_fixed:
            return torch.zeros_like(noise)
        mean, log_deviation = self.parameters_
        return mean.tanh().clamp(-1 + 1e-6, 1 - 1e-6) + log_deviation.clamp(-20, 2).exp() * noise


def agreement(new: StochasticPolicy, old: StochasticPolicy, batch: Batch, of_all: Tensor, clip: float) -> Tensor:
    """Return the scalar product of two gradients, equation 9 of the paper: how the old policy's choices help all.

    The one is of the surrogate's loss with the global advantages (B,) at the new policy, the other of the mean log
    probability at the old one.
    """
    log_ratio = new.log_probability(new(batch.observations), batch.actions) - batch.log_probabilities
    loss = -surrogate(log_ratio.exp(), of_all, clip).mean()
    chosen = old.log_probability(old(batch.observations), batch.actions).mean()
    first = torch.autograd.grad(loss, list(new.parameters()))
    second = torch.autograd.grad(chosen, list(old.parameters()))
    return torch.stack([(one * other).sum() for one, other in zip(first, second, strict=True)]).sum()


def meta_loss(agrees: Tensor, angles: Tensor, social: SocialAdvantages, mean: Tensor, deviation: Tensor) -> Tensor:
    """Return the loss of the angle's distribution: the agreement times the mean standardized advantage."""
    return agrees * ((coordinated(social.own, social.neighbour, angles) - mean) / deviation).mean()


class CopoLearner(PpoLearner):
    """Agents that learn whom to care for; arguments and attributes as in ``PpoLearner``.

    Attributes:
        social_critic: Values (B, 2) of the neighbourhood's and of all agents' rewards.
        angle: Distribution of the local coordination factor.
    """

    kinds = 3
    config: CopoConfig

    def __init__(self, env: AgentRows, config: CopoConfig, seed: int = 0) -> None:
        super().__init__(env, config, seed)
        self._worlds = np.arange(env.num_agents) // env.seats
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed + 1)
            self.social_critic = perceptron([env.observations.shape[1], *config.hidden, 2])
        self._social_descent = Descent(self.social_critic.parameters(), config.rate, config.longest_gradient)
        self.angle = AngleDistribution(config.angle_spread)
        self._angle_adam = torch.optim.Adam(self.angle.parameters(), config.angle_rate)
        self._social_generator = torch.Generator().manual_seed(seed + 1)  # PPO's numbers stay as they are
        self._angles: Float32 = np.zeros(env.num_agents, np.float32)
        self._was_alive: Bool = np.zeros(env.num_agents, np.bool_)
        self._step_angles: list[Float32] = []
        self._networks |= {"social_critic": self.social_critic, "angle": self.angle}
        self._optimizers |= {"social_adam": self._social_descent, "angle_adam": self._angle_adam}
        self._generators["social_generator"] = self._social_generator
        self._arrays |= {"angles": self._angles, "was_alive": self._was_alive}

    # --- experience -----------------------------------------------------------------------------------

    def _before_step(self) -> None:
        """Draw the angles of agents that have appeared, and look where all are."""
        begun = self._env.masks & ~self._was_alive
        if begun.any():
            with torch.no_grad():
                noise = torch.randn(int(begun.sum()), generator=self._social_generator)
                self._angles[begun] = self.angle.draw(noise).numpy()
        self._step_angles.append(self._angles.copy())
        self._positions: Float64 = self._env.positions

    def _rewards(self, alive: Bool) -> Float32:
        """Return the rewards (A, 3): own, of the neighbourhood, of all agents of the world."""
        rewards, worlds = self._env.rewards, self._worlds
        self._was_alive[:] = self._env.masks & ~(self._env.terminals | self._env.truncations)
        near = neighbour_rewards(rewards, self._positions, worlds, alive, self.config.neighbourhood)
        sums = np.bincount(worlds, np.where(alive, rewards, 0.0))
        counts = np.bincount(worlds, alive)
        of_all = (sums / np.maximum(counts, 1))[worlds].astype(np.float32)
        return np.stack([rewards, near, of_all], axis=1)

    # --- learning -------------------------------------------------------------------------------------

    def _update(self, rollout: RolloutBuffer) -> dict[str, float]:
        """Learn from a round: PPO with the coordinated advantages, then the social values, then the angle."""
        config, old = self.config, deepcopy(self.policy)
        own, own_values = self.estimate(self.critic, rollout, (config.gamma,))
        others, other_values = self.estimate(self.social_critic, rollout, (config.gamma, config.global_gamma))
        angles = torch.from_numpy(np.stack(self._step_angles)[rollout.alive])
        self._step_angles.clear()
        mixed = coordinated(own[:, 0], others[:, 0], angles)
        batch = self._batch(rollout, mixed, own + own_values, own_values)
        learned = self._learn(batch)
        returns, loss = others + other_values, torch.zeros(())
        for _ in range(config.epochs):
            for rows in torch.randperm(len(returns), generator=self._social_generator).split(config.minibatch):
                values = self.social_critic(batch.observations[rows])
                loss = (values - returns[rows]).square().mean(dim=0).sum()
                self._social_descent.step(loss)
        learned["social_value_loss"] = float(loss.detach())
        social = SocialAdvantages(own[:, 0], others[:, 0], standardized(others[:, 1]))
        mean, deviation = mixed.mean(), mixed.std().clamp(min=_SMALLEST_DEVIATION)
        self._learn_angle(old, batch, social, mean, deviation)
        angle, log_deviation = self.angle.parameters_.detach()
        return learned | {"angle": 90.0 * float(angle.tanh()), "angle_deviation": 90.0 * float(log_deviation.exp())}

    def _learn_angle(
        self, old: StochasticPolicy, batch: Batch, social: SocialAdvantages, mean: Tensor, deviation: Tensor
    ) -> None:
        """Move the angle's distribution to where the agents' choices help all."""
        for _ in range(self.config.angle_epochs):
            order = torch.randperm(len(batch.advantages), generator=self._social_generator)
            for rows in order.split(self.config.minibatch):
                part = SocialAdvantages(*(values[rows] for values in social))
                agrees = agreement(self.policy, old, batch.take(rows), part.all, self.config.clip)
                angles = self.angle.draw(torch.randn(len(rows), generator=self._social_generator))
                self._angle_adam.zero_grad()
                meta_loss(agrees, angles, part, mean, deviation).backward()
                self._angle_adam.step()
