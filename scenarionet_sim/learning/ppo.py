"""Proximal policy optimization (Schulman et al. 2017) for agents that come and go; IPPO is the same for many agents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_data.arrays.dtypes import Bool, Float32
from scenarionet_sim.learning.config import PpoConfig
from scenarionet_sim.learning.descent import Descent
from scenarionet_sim.learning.learner import Learner
from scenarionet_sim.learning.networks import StochasticPolicy, make_policy, perceptron
from scenarionet_sim.learning.rollout import RolloutBuffer, advantages
from scenarionet_sim.learning.rows import AgentRows


class Batch(NamedTuple):
    """B steps of agents.

    Attributes:
        observations: (B, D).
        actions: (B, 2).
        log_probabilities: (B,) of the actions under the policy that chose them.
        advantages: (B,) standardized.
        returns: (B, K) targets of the values.
        values: (B, K) values before the update.
    """

    observations: Tensor
    actions: Tensor
    log_probabilities: Tensor
    advantages: Tensor
    returns: Tensor
    values: Tensor

    def take(self, rows: Tensor) -> Batch:
        """Return some rows."""
        return Batch(*(values.index_select(0, rows) for values in self))


def surrogate(ratio: Tensor, advantage: Tensor, clip: float) -> Tensor:
    """Return the clipped surrogate objective (B,), equation 7 of the paper."""
    return torch.minimum(ratio * advantage, ratio.clamp(1.0 - clip, 1.0 + clip) * advantage)


def ppo_loss(
    policy: StochasticPolicy, critic: nn.Module, batch: Batch, config: PpoConfig
) -> tuple[Tensor, dict[str, Tensor]]:
    """Return the loss of a batch (equation 9 of the paper), and its parts."""
    given = policy(batch.observations)
    log_ratio = policy.log_probability(given, batch.actions) - batch.log_probabilities
    policy_loss = -surrogate(log_ratio.exp(), batch.advantages, config.clip).mean()
    values = critic(batch.observations)
    errors = (values - batch.returns).square()
    if config.value_clip:
        near = batch.values + (values - batch.values).clamp(-config.value_clip, config.value_clip)
        errors = torch.maximum(errors, (near - batch.returns).square())
    value_loss, entropy = errors.mean(dim=0).sum(), policy.entropy(given).mean()
    loss = policy_loss + config.value_weight * value_loss - config.entropy * entropy
    with torch.no_grad():
        divergence = (log_ratio.exp() - 1.0 - log_ratio).mean()  # Schulman's estimator
    return loss, {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "divergence": divergence,
    }


def standardized(values: Tensor) -> Tensor:
    """Return values with mean 0 and deviation 1."""
    return (values - values.mean()) / (values.std() + 1e-8)


class PpoLearner(Learner):
    """A policy and a value function that learn from rounds of experience.

    Args:
        env: Where the agents drive; it has been reset.
        config: Settings.
        seed: Seed of weights, actions and minibatches.

    Attributes:
        policy: The policy.
        critic: Values (B, 1) of observations.
    """

    kinds = 1
    """Number K of rewards of an agent in each step."""

    def __init__(self, env: AgentRows, config: PpoConfig, seed: int = 0) -> None:
        super().__init__(env, seed)
        self.config, self._lambda = config, config.smoothing
        width = env.observations.shape[1]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.policy = make_policy(width, config.hidden, config.bins, config.spread)
            self.critic = perceptron([width, *config.hidden, 1])
        parameters = [*self.policy.parameters(), *self.critic.parameters()]
        self._descent = Descent(parameters, config.rate, config.longest_gradient)
        self._networks |= {"policy": self.policy, "critic": self.critic}
        self._optimizers["adam"] = self._descent
        self._rollout = RolloutBuffer.empty(config.horizon, env.num_agents, width, self.kinds)

    @property
    def num_bytes(self) -> int:
        """Memory of the experience."""
        return self._rollout.num_bytes

    def round(self) -> tuple[int, dict[str, float]]:
        """Collect experience and learn from it; return its steps of agents, and means over the minibatches."""
        rollout = self._collect()
        with self.clock("update"):
            learned = self._update(rollout)
        return int(rollout.alive.sum()), learned

    def mode(self, observations: Float32) -> Float32:
        """Return the controls (B, 2) of the policy for observations (B, D), without chance."""
        with torch.no_grad():
            given = self.policy(torch.from_numpy(observations))
            controls: Float32 = self.policy.controls(self.policy.mode(given)).numpy()
        return controls

    # --- experience -----------------------------------------------------------------------------------

    def _collect(self) -> RolloutBuffer:
        """Drive for a round."""
        env, rollout = self._env, self._rollout
        rollout.begin()
        distributions: list[Tensor] = []
        chosen: list[Tensor] = []
        for step in range(self.config.horizon):  # sequential by nature
            with self.clock("inference"), torch.inference_mode():
                seen = rollout.observations[step].copy_(torch.from_numpy(env.observations))
                alive = rollout.alive[step] = env.masks
                rows = torch.from_numpy(np.flatnonzero(alive))
                given = self.policy(seen.index_select(0, rows))
                actions = self.policy.draw(given, self._generator)
                rollout.actions[step, rows] = actions
                distributions.append(given)
                chosen.append(actions)
                controls = self.policy.controls(rollout.actions[step]).numpy()
            with self.clock("environment"):
                self._before_step()
                env.step(controls)
                self.outcomes.add(env)
                rollout.rewards[step] = self.config.reward_scale * self._rewards(rollout.alive[step])
                rollout.end_step(step, env)
        rollout.observations[-1] = torch.from_numpy(env.observations)
        with self.clock("inference"), torch.inference_mode():
            found = self.policy.log_probability(torch.cat(distributions), torch.cat(chosen))
            rollout.log_probabilities[torch.from_numpy(rollout.alive)] = found
        return rollout

    def _before_step(self) -> None:
        """Look at the environment before a step."""

    def _rewards(self, alive: Bool) -> Float32:
        """Return the rewards (A, K) of the last step; the first kind is what the policy's critic predicts."""
        del alive
        return self._env.rewards[:, None]

    # --- learning -------------------------------------------------------------------------------------

    def _update(self, rollout: RolloutBuffer) -> dict[str, float]:
        """Learn from a round."""
        estimates, values = self.estimate(self.critic, rollout, (self.config.gamma,))
        return self._learn(self._batch(rollout, estimates[:, 0], estimates + values, values))

    def estimate(self, critic: nn.Module, rollout: RolloutBuffer, gammas: Sequence[float]) -> tuple[Tensor, Tensor]:
        """Return the advantages (N, K) of all steps of agents, and the values (N, K) of their observations.

        Args:
            critic: Values of K kinds of rewards: the first ones for one kind, the last ones for several.
            rollout: The experience.
            gammas: Discount of each kind.
        """
        alive = np.concatenate([rollout.alive, self._env.masks[None]])
        values = np.zeros((*alive.shape, len(gammas)), np.float32)
        last_values = np.zeros_like(values[:-1])
        with torch.no_grad():
            here = torch.from_numpy(np.flatnonzero(alive))
            values[alive] = critic(rollout.observations.flatten(0, 1).index_select(0, here)).numpy()
            if rollout.last:
                found = critic(torch.cat([seen for _, _, seen in rollout.last])).numpy()
                late = np.concatenate(rollout.is_late)
                steps = np.concatenate([np.full(len(rows), step) for step, rows, _ in rollout.last])
                rows = np.concatenate([rows for _, rows, _ in rollout.last])
                last_values[steps[late], rows[late]] = found[late]
        rewards = rollout.rewards[..., : len(gammas)] if len(gammas) == 1 else rollout.rewards[..., -len(gammas) :]
        estimates = [
            advantages(rewards[..., kind], values[..., kind], last_values[..., kind], rollout.ends, gamma, self._lambda)
            for kind, gamma in enumerate(gammas)
        ]
        found = np.stack(estimates, axis=2)[rollout.alive]
        return torch.from_numpy(found), torch.from_numpy(values[:-1][rollout.alive])

    def _batch(self, rollout: RolloutBuffer, estimates: Tensor, returns: Tensor, values: Tensor) -> Batch:
        """Return all steps of agents, with the advantages (N,) that the policy follows."""
        rows = rollout.rows()
        return Batch(
            rollout.observations.flatten(0, 1).index_select(0, rows),
            rollout.actions.flatten(0, 1).index_select(0, rows),
            rollout.log_probabilities.flatten().index_select(0, rows),
            standardized(estimates),
            returns,
            values,
        )

    def _learn(self, batch: Batch) -> dict[str, float]:
        """Descend along the loss of minibatches; return means of its parts."""
        seen: list[dict[str, Tensor]] = []
        for _ in range(self.config.epochs):
            order = torch.randperm(len(batch.advantages), generator=self._generator)
            for rows in order.split(self.config.minibatch):
                loss, parts = ppo_loss(self.policy, self.critic, batch.take(rows), self.config)
                self._descent.step(loss)
                seen.append({name: value.detach() for name, value in parts.items()})
        return {name: float(torch.stack([parts[name] for parts in seen]).mean()) for name in seen[0]}
