"""TD3 (Fujimoto et al. 2018) with one replay of the transitions of all agents."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_sim.learning.config import Td3Config
from scenarionet_sim.learning.learner import Learner
from scenarionet_sim.learning.networks import NUM_CONTROLS
from scenarionet_sim.learning.rows import AgentRows


def rectified(inputs: int, hidden: tuple[int, ...], outputs: int) -> nn.Sequential:
    """Return dense layers with rectifiers between them, as in the paper."""
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [nn.Linear(inputs, width), nn.ReLU()]
        inputs = width
    return nn.Sequential(*layers, nn.Linear(inputs, outputs))


class ReplayBuffer:
    """The newest transitions, in a ring.

    Attributes:
        tensors: Observations, actions, rewards, observations after, and whether the episode goes on, each (N, ...).
        added: Transitions added so far.
    """

    def __init__(self, capacity: int, width: int) -> None:
        shapes = {"seen": (width,), "actions": (NUM_CONTROLS,), "rewards": (), "after": (width,), "goes_on": ()}
        self.tensors = {name: torch.zeros(capacity, *shape) for name, shape in shapes.items()}
        self.capacity, self.added = capacity, 0

    def add(self, **parts: Tensor) -> None:
        """Add transitions."""
        count = len(parts["rewards"])
        rows = torch.arange(self.added, self.added + count) % self.capacity
        for name, values in parts.items():
            self.tensors[name][rows] = values
        self.added += count

    def draw(self, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Return random transitions."""
        rows = torch.randint(min(self.added, self.capacity), (count,), generator=generator)
        return {name: values[rows] for name, values in self.tensors.items()}


class Td3Learner(Learner):
    """A deterministic policy with two critics; arguments and attributes as in ``PpoLearner``.

    Attributes:
        networks: policy, critics ``first`` and ``second``, and their slow copies.
    """

    def __init__(self, env: AgentRows, config: Td3Config, seed: int = 0) -> None:
        super().__init__(env, seed)
        self.config = config
        width = env.observations.shape[1]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.policy = nn.Sequential(rectified(width, config.hidden, NUM_CONTROLS), nn.Tanh())
            first, second = (rectified(width + NUM_CONTROLS, config.hidden, 1) for _ in range(2))
        self.networks = self._networks
        self.networks |= {"policy": self.policy, "first": first, "second": second}
        self.networks |= {f"slow_{name}": deepcopy(net) for name, net in self.networks.items()}
        critics = [*first.parameters(), *second.parameters()]
        self._policy_adam = torch.optim.Adam(self.policy.parameters(), config.rate, fused=True)
        self._critic_adam = torch.optim.Adam(critics, config.rate, fused=True)
        self._optimizers |= {"policy_adam": self._policy_adam, "critic_adam": self._critic_adam}
        self._replay, self._updates = ReplayBuffer(config.replay, width), 0

    @property
    def num_bytes(self) -> int:
        """Memory of the experience."""
        return int(sum(values.nbytes for values in self._replay.tensors.values()))

    def round(self) -> tuple[int, dict[str, float]]:
        """Drive ``horizon`` steps and learn from the replay; return the steps of agents, and numbers."""
        before, config = self._replay.added, self.config
        for _ in range(config.horizon):  # sequential by nature
            self._step()
        added = self._replay.added
        learned: dict[str, Tensor] = {}
        if added > config.warm_up:
            due = int(config.updates * added) - int(config.updates * before)
            with self.clock("update"):
                for _ in range(due):
                    learned |= self._update()
        return added - before, {name: float(value) for name, value in learned.items()}

    def mode(self, observations: Float32) -> Float32:
        """Return the controls (B, 2) of the policy for observations (B, D), without chance."""
        with torch.no_grad():
            controls: Float32 = self.policy(torch.from_numpy(observations)).numpy()
        return controls

    def tensors(self) -> dict[str, Tensor]:
        """Return everything that the next rounds depend on, except the environment."""
        replay, count = self._replay, min(self._replay.added, self._replay.capacity)
        found = super().tensors() | {f"replay.{name}": values[:count] for name, values in replay.tensors.items()}
        return found | {"counts": torch.tensor([replay.added, self._updates])}

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Continue from :meth:`tensors`."""
        super().restore(tensors)
        for name, values in self._replay.tensors.items():
            values[: len(tensors[f"replay.{name}"])] = tensors[f"replay.{name}"]
        self._replay.added, self._updates = tensors["counts"].tolist()

    def _step(self) -> None:
        """Drive one step with noise, and add the transitions to the replay."""
        env, config = self._env, self.config
        with self.clock("inference"), torch.no_grad():
            rows = np.flatnonzero(env.masks)
            seen = torch.from_numpy(env.observations[rows])
            noise = torch.randn(len(rows), NUM_CONTROLS, generator=self._generator)
            if self._replay.added < config.warm_up:
                actions = torch.rand(len(rows), NUM_CONTROLS, generator=self._generator) * 2.0 - 1.0
            else:
                actions = (self.policy(seen) + config.noise * noise).clamp(-1.0, 1.0)
            controls = np.zeros((env.num_agents, NUM_CONTROLS), np.float32)
            controls[rows] = actions.numpy()
        with self.clock("environment"):
            env.step(controls)
            self.outcomes.add(env)
            ended = (env.terminals | env.truncations)[rows, None]
            after = np.where(ended, env.last_observations[rows], env.observations[rows])
            self._replay.add(
                seen=seen,
                actions=actions,
                rewards=torch.from_numpy(config.reward_scale * env.rewards[rows]),
                after=torch.from_numpy(after),
                goes_on=torch.from_numpy((~env.terminals[rows]).astype(np.float32)),
            )

    def _update(self) -> dict[str, Tensor]:
        """Descend along the critics' loss, and with a delay along the policy's."""
        config, nets = self.config, self.networks
        drawn = self._replay.draw(config.minibatch, self._generator)
        with torch.no_grad():
            noise = config.target_noise * torch.randn(drawn["actions"].shape, generator=self._generator)
            noise = noise.clamp(-config.target_clip, config.target_clip)
            following = torch.cat(
                [drawn["after"], (nets["slow_policy"](drawn["after"]) + noise).clamp(-1.0, 1.0)], dim=1
            )
            worst = torch.minimum(nets["slow_first"](following), nets["slow_second"](following))[:, 0]
            target = drawn["rewards"] + config.gamma * drawn["goes_on"] * worst
        pairs = torch.cat([drawn["seen"], drawn["actions"]], dim=1)
        errors = [(nets[name](pairs)[:, 0] - target).square().mean() for name in ("first", "second")]
        critic_loss = errors[0] + errors[1]
        self._critic_adam.zero_grad()
        critic_loss.backward()
        self._critic_adam.step()
        self._updates += 1
        learned = {"critic_loss": critic_loss.detach(), "value": target.mean()}
        if self._updates % config.delay == 0:
            chosen = torch.cat([drawn["seen"], self.policy(drawn["seen"])], dim=1)
            policy_loss = -nets["first"](chosen).mean()
            self._policy_adam.zero_grad()
            policy_loss.backward()
            self._policy_adam.step()
            with torch.no_grad():  # the slow copies follow
                for name in ("policy", "first", "second"):
                    slow = list(nets[f"slow_{name}"].parameters())
                    torch._foreach_lerp_(slow, list(nets[name].parameters()), config.tau)
            learned["policy_loss"] = policy_loss.detach()
        return learned
