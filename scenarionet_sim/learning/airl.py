"""Adversarial inverse reinforcement learning (Fu et al. 2018) with inverse dynamics, for many agents.

The discriminator is ``D = e^f / (e^f + pi(a|s))`` with ``f = g(s) + gamma h(s') - h(s)``. Recordings have no actions:
those of the experts come from inverse dynamics ``a = I(s, s')``, learned from the policy's own transitions.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from scenarionet_sim.learning.config import AirlConfig
from scenarionet_sim.learning.experts import Experts
from scenarionet_sim.learning.gail import GailLearner
from scenarionet_sim.learning.networks import NUM_CONTROLS, perceptron
from scenarionet_sim.learning.rows import AgentRows


class InverseDynamics:
    """Predicts the controls that lead from one observation to the next.

    Args:
        width: D.
        hidden: Widths of the hidden layers.
        rate: Learning rate.

    Attributes:
        network: Controls (B, 2) of pairs of observations: the first one and their difference (B, 2 D).
        adam: Its optimizer.
    """

    def __init__(self, width: int, hidden: tuple[int, ...], rate: float) -> None:
        self.network = perceptron([2 * width, *hidden, NUM_CONTROLS])
        self.adam = torch.optim.Adam(self.network.parameters(), rate, fused=True)

    def __call__(self, pairs: Tensor) -> Tensor:
        """Return the controls (B, 2) of pairs (B, 2, D); a small change of an observation is as large as it is."""
        found: Tensor = self.network(torch.cat([pairs[:, 0], (pairs[:, 1] - pairs[:, 0]) * 10.0], dim=1))
        return found

    def learn(self, pairs: Tensor, controls: Tensor, steps: int, minibatch: int, generator: torch.Generator) -> float:
        """Descend along the squared error of random minibatches; return its last value."""
        loss = torch.zeros(())
        for _ in range(steps):
            rows = torch.randint(len(pairs), (minibatch,), generator=generator)
            loss = (self(pairs[rows]) - controls[rows]).square().mean()
            self.adam.zero_grad()
            loss.backward()
            self.adam.step()
        return float(loss.detach())

    def error(self, pairs: Tensor, controls: Tensor) -> float:
        """Return the mean squared error as a share of the variance of the controls."""
        with torch.no_grad():
            missed = (self(pairs) - controls).square().mean()
        return float(missed / controls.var(dim=0, correction=0).mean().clamp(min=1e-8))


class AirlLearner(GailLearner):
    """PPO whose rewards are recovered from experts; arguments and attributes as in ``GailLearner``."""

    config: AirlConfig

    def __init__(self, env: AgentRows, config: AirlConfig, seed: int, experts: Experts) -> None:
        super().__init__(env, config, seed, experts)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed + 2)
            self.inverse = InverseDynamics(env.observations.shape[1], config.hidden, config.inverse_rate)
        self._networks["inverse"], self._optimizers["inverse_adam"] = self.inverse.network, self.inverse.adam

    def logits(self, pairs: Tensor, log_probabilities: Tensor) -> Tensor:
        """Return log D - log(1 - D) = f(s, s') - log pi(a|s) (B,) of pairs of observations (B, 2, D)."""
        seen, after = self._inputs(pairs).unbind(dim=1)
        reward, shaping = self.discriminators["reward"], self.discriminators["shaping"]
        found = reward(seen) + self.config.gamma * shaping(after) - shaping(seen)
        result: Tensor = found[:, 0] - log_probabilities
        return result

    def expert_log_probabilities(self, pairs: Tensor) -> Tensor:
        """Return the log probabilities (B,) under the policy of the actions that inverse dynamics finds."""
        with torch.no_grad():
            controls = self.inverse(pairs).clamp(-1.0, 1.0)
            given = self.policy(pairs[:, 0])
            return self.policy.log_probability(given, self.policy.nearest(controls))

    def _make_discriminators(self, width: int) -> dict[str, nn.Module]:
        hidden = self.config.hidden
        return {"reward": perceptron([width, *hidden, 1]), "shaping": perceptron([width, *hidden, 1])}

    def _before_discriminator(self, pairs: Tensor, actions: Tensor) -> dict[str, float]:
        """Learn inverse dynamics from nine tenths of the policy's own transitions, until it knows the others."""
        config, controls = self.config, self.policy.controls(actions)
        held = torch.arange(len(pairs)) % 10 == 0
        kept = ~held if len(pairs) > 1 else held
        loss = error = 0.0
        for _ in range(config.inverse_series):
            loss = self.inverse.learn(
                pairs[kept], controls[kept], config.inverse_steps, config.inverse_minibatch, self._imitation_generator
            )
            error = self.inverse.error(pairs[held], controls[held])
            if error < config.inverse_error:
                break
        return {"inverse_loss": loss, "inverse_error": error}
