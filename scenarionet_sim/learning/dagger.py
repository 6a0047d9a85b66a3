"""DAgger (Ross, Gordon and Bagnell 2011): imitation of a teacher in the states that the learner itself comes to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from scenarionet_data.arrays.dtypes import Bool, Float32, Int64
from scenarionet_sim.learning.config import DaggerConfig
from scenarionet_sim.learning.descent import Descent
from scenarionet_sim.learning.learner import Learner
from scenarionet_sim.learning.networks import NUM_CONTROLS, GaussianPolicy
from scenarionet_sim.learning.rows import AgentRows

_LEAST_DEVIATION = 0.01
"""Columns that vary less, such as those of lights where there are none, are not magnified further."""

_LONGEST_GRADIENT = 10.0
"""Gradients are scaled down to this norm: the teacher jumps where an object appears."""


class DaggerLearner(Learner):
    """A policy that learns what a teacher would do; the last two columns of its rows are the teacher's controls.

    The loss is the negative log likelihood of the teacher's controls, so that each control's squared error counts as
    much as its own deviation is small: steering is some 50 times smaller than throttle. Inputs are normalised by the
    mean and deviation of the first round, which the teacher drives; checkpoints have both within the first layer.

    Args:
        env: Where the agents drive, with ``Guidance`` behind the observation; it has been reset.
        config: Settings.
        seed: Seed of weights, of the rows that the teacher drives, and of minibatches.

    Attributes:
        policy: The policy, of normalised observations.
    """

    def __init__(self, env: AgentRows, config: DaggerConfig, seed: int = 0) -> None:
        super().__init__(env, seed)
        self.config = config
        self._width = width = env.observations.shape[1] - NUM_CONTROLS
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.policy = GaussianPolicy(width, config.hidden, config.spread)
        self._descent = Descent(self.policy.parameters(), config.rate, _LONGEST_GRADIENT)
        self._networks["student"], self._optimizers["adam"] = self.policy, self._descent
        self._kept = torch.zeros(config.replay, width + NUM_CONTROLS)
        self._mean, self._deviation = np.zeros(width, np.float32), np.ones(width, np.float32)
        self._counts: Int64 = np.zeros(2, np.int64)  # rounds, states
        self._arrays |= {"mean": self._mean, "deviation": self._deviation, "counts": self._counts}

    @property
    def num_bytes(self) -> int:
        """Memory of the experience."""
        return int(self._kept.nbytes)

    def round(self) -> tuple[int, dict[str, float]]:
        """Drive ``horizon`` steps and imitate; return the steps of agents, and numbers."""
        config, before = self.config, int(self._counts[1])
        rounds = int(self._counts[0])
        share = config.share * 0.5 ** (rounds / config.half_life)
        is_taught = torch.rand(self._env.num_agents, generator=self._generator).numpy() < share
        for _ in range(config.horizon):  # sequential by nature
            self._step(is_taught)
        added = int(self._counts[1])
        known = self._kept[: min(added, config.replay)]
        if rounds == 0 and len(known):
            self._mean[:] = known[:, : self._width].mean(dim=0).numpy()
            self._deviation[:] = known[:, : self._width].std(dim=0).clamp(min=_LEAST_DEVIATION).numpy()
        self._counts[0] += 1
        self._descent.set_rate(config.rate * max(1.0 - before / config.steps, 0.01))
        with self.clock("update"):
            losses = [self._update(known) for _ in range(config.updates if len(known) else 0)]
        steering, throttle = self.policy.log_std.detach().exp().tolist()
        learned = {"share": share, "steering_error": steering, "throttle_error": throttle}
        return added - before, learned | ({"loss": float(torch.stack(losses).mean())} if losses else {})

    def mode(self, observations: Float32) -> Float32:
        """Return the controls (B, 2) of the policy for observations (B, D), without the teacher's columns."""
        with torch.no_grad():
            controls: Float32 = self.policy.controls(self.policy(self._normal(torch.from_numpy(observations)))).numpy()
        return controls

    def loss(self, rows: Tensor) -> Tensor:
        """Return the loss of rows (B, D + 2) of observations and the teacher's controls."""
        seen, taught = rows[:, : self._width], rows[:, self._width :]
        return -self.policy.log_probability(self.policy(self._normal(seen)), taught).mean()

    def tensors(self) -> dict[str, Tensor]:
        """Return everything that the next rounds depend on, and ``policy``, which takes observations as they are."""
        found = super().tensors()
        policy = {name: value.clone() for name, value in self.policy.state_dict().items()}
        weight = policy["body.0.weight"] / torch.from_numpy(self._deviation)
        policy |= {
            "body.0.weight": weight,
            "body.0.bias": policy["body.0.bias"] - weight @ torch.from_numpy(self._mean),
        }
        known = self._kept[: min(int(self._counts[1]), self.config.replay)]
        return found | {f"policy.{name}": value for name, value in policy.items()} | {"kept": known}

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Continue from :meth:`tensors`."""
        super().restore(tensors)
        self._kept[: len(tensors["kept"])] = tensors["kept"]

    def _normal(self, seen: Tensor) -> Tensor:
        return (seen - torch.from_numpy(self._mean)) / torch.from_numpy(self._deviation)

    def _step(self, is_taught: Bool) -> None:
        """Drive one step, the teacher in its rows, and keep what was seen and what the teacher would do."""
        env = self._env
        with self.clock("inference"):
            rows = torch.from_numpy(env.observations[env.masks])
            places = (int(self._counts[1]) + torch.arange(len(rows))) % self.config.replay
            self._kept[places] = rows
            self._counts[1] += len(rows)
            taught = env.observations[:, self._width :]
            controls = np.where(is_taught[:, None], taught, self.mode(env.observations[:, : self._width]))
        with self.clock("environment"):
            env.step(controls)
            self.outcomes.add(env)

    def _update(self, known: Tensor) -> Tensor:
        """Descend along the loss of a minibatch; return it."""
        drawn = torch.randint(len(known), (self.config.minibatch,), generator=self._generator)
        loss = self.loss(known.index_select(0, drawn))
        self._descent.step(loss)
        return loss.detach()
