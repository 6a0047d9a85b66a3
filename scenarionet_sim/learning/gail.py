"""Generative adversarial imitation (Ho and Ermon 2016) from states alone, for many agents.

The discriminator sees pairs of consecutive observations, of experts and of the policy, and never an action: recordings
have none.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from scenarionet_sim.learning.config import GailConfig
from scenarionet_sim.learning.experts import Experts
from scenarionet_sim.learning.networks import perceptron
from scenarionet_sim.learning.ppo import PpoLearner
from scenarionet_sim.learning.rollout import RolloutBuffer
from scenarionet_sim.learning.rows import AgentRows


class GailLearner(PpoLearner):
    """PPO whose rewards are a discriminator's belief that a transition is an expert's.

    Args:
        env: Where the agents drive; it has been reset.
        config: Settings.
        seed: Seed of weights, actions and minibatches.
        experts: Transitions of the experts.

    Attributes:
        discriminator: Logits (B, 1) of pairs of observations (B, 2 D).
    """

    config: GailConfig

    def __init__(self, env: AgentRows, config: GailConfig, seed: int, experts: Experts) -> None:
        super().__init__(env, config, seed)
        self._experts = experts
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed + 1)
            self.discriminators = self._make_discriminators(env.observations.shape[1])
        parameters = [each for net in self.discriminators.values() for each in net.parameters()]
        self._discriminator_adam = torch.optim.Adam(
            parameters, config.discriminator_rate, weight_decay=config.discriminator_decay, fused=True
        )
        self._imitation_generator = torch.Generator().manual_seed(seed + 1)
        self._networks |= self.discriminators
        self._optimizers["discriminator_adam"] = self._discriminator_adam
        self._generators["imitation_generator"] = self._imitation_generator

    def logits(self, pairs: Tensor, log_probabilities: Tensor) -> Tensor:
        """Return the logits (B,) that pairs of observations (B, 2, D) are an expert's."""
        del log_probabilities
        found: Tensor = self.discriminators["discriminator"](self._inputs(pairs).flatten(1))[:, 0]
        return found

    def expert_log_probabilities(self, pairs: Tensor) -> Tensor:
        """Return what ``logits`` needs for pairs of experts (B, 2, D)."""
        return pairs.new_zeros(len(pairs))

    def _make_discriminators(self, width: int) -> dict[str, nn.Module]:
        return {"discriminator": perceptron([2 * width, *self.config.hidden, 1])}

    def _inputs(self, observations: Tensor) -> Tensor:
        """Return observations (..., D) as the discriminator sees them."""
        if self.config.normalizes:
            observations = (observations - self._experts.mean) / self._experts.deviation
        if self.config.input_noise:
            noise = torch.randn(observations.shape, generator=self._imitation_generator)
            observations = observations + self.config.input_noise * noise
        return observations

    def _update(self, rollout: RolloutBuffer) -> dict[str, float]:
        """Learn from a round: the discriminator, the rewards, then PPO."""
        rows = rollout.rows()
        seen = rollout.observations[:-1].flatten(0, 1)[rows]
        pairs = torch.stack([seen, rollout.next_observations().flatten(0, 1)[rows]], dim=1)
        logs = rollout.log_probabilities.flatten()[rows]
        learned = self._before_discriminator(pairs, rollout.actions.flatten(0, 1)[rows])
        learned |= self._learn_discriminator(pairs, logs)
        with torch.no_grad():
            logits = self.logits(pairs, logs)
            given = logits if self.config.reward == "logit" else nn.functional.softplus(logits)  # -log(1 - D)
        rollout.rewards[rollout.alive, 0] = given.numpy()
        return learned | {"given": float(given.mean())} | super()._update(rollout)

    def _before_discriminator(self, pairs: Tensor, actions: Tensor) -> dict[str, float]:
        """Learn what the discriminator needs."""
        del pairs, actions
        return {}

    def _learn_discriminator(self, pairs: Tensor, log_probabilities: Tensor) -> dict[str, float]:
        """Tell experts' transitions from the policy's; return the mean loss and accuracy."""
        config, losses, right = self.config, [], []
        for _ in range(config.discriminator_epochs):
            order = torch.randperm(len(pairs), generator=self._imitation_generator)
            for rows in order.split(config.discriminator_minibatch):
                expert = self._experts.draw(len(rows), self._imitation_generator)
                theirs = self.logits(expert, self.expert_log_probabilities(expert))
                mine = self.logits(pairs[rows], log_probabilities[rows])
                loss = nn.functional.softplus(-theirs).mean() + nn.functional.softplus(mine).mean()
                if config.gradient_penalty:
                    loss = loss + config.gradient_penalty * self._penalty(expert, pairs[rows])
                self._discriminator_adam.zero_grad()
                loss.backward()
                self._discriminator_adam.step()
                losses.append(loss.detach())
                right.append(((theirs > 0).float().mean() + (mine < 0).float().mean()).detach() / 2)
        return {
            "discriminator_loss": float(torch.stack(losses).mean()),
            "discriminator_accuracy": float(torch.stack(right).mean()),
        }

    def _penalty(self, expert: Tensor, mine: Tensor) -> Tensor:
        """Return how far the gradient's norm is from 1 between experts and policy (Gulrajani et al. 2017)."""
        share = torch.rand(len(mine), 1, 1, generator=self._imitation_generator)
        between = (share * expert + (1.0 - share) * mine).requires_grad_()
        total = self.logits(between, between.new_zeros(len(between))).sum()
        (gradient,) = torch.autograd.grad(total, between, create_graph=True)
        return (gradient.flatten(1).norm(dim=1) - 1.0).square().mean()
