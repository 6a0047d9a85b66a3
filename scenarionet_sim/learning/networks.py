"""Networks of the algorithms: perceptrons, and policies that return a distribution over actions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

NUM_CONTROLS = 2
"""Steering and throttle."""


class _Tanh(nn.Module):
    """Hyperbolic tangent in place of its argument, whose values the dense layer before does not need."""

    def forward(self, values: Tensor) -> Tensor:
        return values.tanh_()


def perceptron(sizes: Sequence[int], last: float = 1.0) -> nn.Sequential:
    """Return dense layers with tanh between them, with orthogonal weights.

    Args:
        sizes: Number of inputs, of units per hidden layer, and of outputs.
        last: Scale of the last layer's weights: small for actions, 1 for values.
    """
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layer = nn.Linear(inputs, outputs)
        nn.init.orthogonal_(layer.weight, last if len(layers) == 2 * (len(sizes) - 2) else math.sqrt(2.0))
        nn.init.zeros_(layer.bias)
        layers += [layer, _Tanh()]
    return nn.Sequential(*layers[:-1])


class GaussianPolicy(nn.Module):
    """Independent normal distributions of the controls, with a deviation that does not depend on the state.

    Actions are the drawn numbers; the environment clips them to [-1, 1].

    Attributes:
        body: Observations (B, D) to means (B, 2).
        log_std: (2,) logarithms of the deviations.
    """

    def __init__(self, inputs: int, hidden: Sequence[int], spread: float) -> None:
        super().__init__()
        self.body = perceptron([inputs, *hidden, NUM_CONTROLS], last=0.01)
        self.log_std = nn.Parameter(torch.full((NUM_CONTROLS,), math.log(spread)))

    def forward(self, observations: Tensor) -> Tensor:
        """Return the parameters of the distributions: the means (B, 2)."""
        means: Tensor = self.body(observations)
        return means

    def draw(self, means: Tensor, generator: torch.Generator) -> Tensor:
        """Return a random action (B, 2) for each row."""
        return means + self.log_std.exp() * torch.randn(means.shape, generator=generator)

    def mode(self, means: Tensor) -> Tensor:
        """Return the most probable action (B, 2) for each row."""
        return means

    def log_probability(self, means: Tensor, actions: Tensor) -> Tensor:
        """Return the log density (B,) of actions."""
        apart = (actions - means) / self.log_std.exp()
        return (-0.5 * apart.square() - self.log_std - 0.5 * math.log(2.0 * math.pi)).sum(dim=1)

    def entropy(self, means: Tensor) -> Tensor:
        """Return the entropy (B,) of the distributions."""
        return (self.log_std.sum() + 0.5 * NUM_CONTROLS * (1.0 + math.log(2.0 * math.pi))).expand(len(means))

    def controls(self, actions: Tensor) -> Tensor:
        """Return steering and throttle (B, 2) in [-1, 1] of actions."""
        return actions.clamp(-1.0, 1.0)

    def nearest(self, controls: Tensor) -> Tensor:
        """Return the actions (B, 2) of controls (B, 2)."""
        return controls


class DiscretePolicy(nn.Module):
    """One categorical distribution for each control, over values that divide [-1, 1] evenly.

    Actions are numbers of the values.

    Attributes:
        body: Observations (B, D) to logits (B, 2 * bins).
    """

    def __init__(self, inputs: int, hidden: Sequence[int], bins: int) -> None:
        super().__init__()
        self.body = perceptron([inputs, *hidden, NUM_CONTROLS * bins], last=0.01)
        self._bins = bins

    def forward(self, observations: Tensor) -> Tensor:
        """Return the parameters of the distributions: log probabilities (B, 2, bins)."""
        return self.body(observations).view(-1, NUM_CONTROLS, self._bins).log_softmax(dim=2)

    def draw(self, logs: Tensor, generator: torch.Generator) -> Tensor:
        """Return a random action (B, 2) for each row."""
        flat = logs.exp().view(-1, self._bins)
        return torch.multinomial(flat, 1, generator=generator).view(-1, NUM_CONTROLS).to(logs.dtype)

    def mode(self, logs: Tensor) -> Tensor:
        """Return the most probable action (B, 2) for each row."""
        return logs.argmax(dim=2).to(logs.dtype)

    def log_probability(self, logs: Tensor, actions: Tensor) -> Tensor:
        """Return the log probability (B,) of actions."""
        return logs.gather(2, actions.long().unsqueeze(2)).squeeze(2).sum(dim=1)

    def entropy(self, logs: Tensor) -> Tensor:
        """Return the entropy (B,) of the distributions."""
        return -(logs.exp() * logs).sum(dim=(1, 2))

    def controls(self, actions: Tensor) -> Tensor:
        """Return steering and throttle (B, 2) in [-1, 1] of actions."""
        return actions * (2.0 / (self._bins - 1)) - 1.0

    def nearest(self, controls: Tensor) -> Tensor:
        """Return the actions (B, 2) whose controls are nearest to given ones."""
        return ((controls + 1.0) * (0.5 * (self._bins - 1))).round()


StochasticPolicy = GaussianPolicy | DiscretePolicy


def make_policy(inputs: int, hidden: Sequence[int], bins: int, spread: float) -> StochasticPolicy:
    """Return a continuous policy, or with ``bins`` a discrete one."""
    return DiscretePolicy(inputs, hidden, bins) if bins else GaussianPolicy(inputs, hidden, spread)
