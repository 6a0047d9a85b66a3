"""What learners share: the rows they drive, the outcomes, and the parts that a checkpoint keeps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.learning.descent import Descent
from scenarionet_sim.learning.rows import AgentRows, Clock, Outcomes


class Learner:
    """Base class of learners, which name their parts.

    Args:
        env: Where the agents drive; it has been reset.
        seed: Seed of actions and minibatches.

    Attributes:
        outcomes: What the agents' episodes achieved.
        clock: Wall time by activity.
    """

    def __init__(self, env: AgentRows, seed: int) -> None:
        self._env, self.outcomes, self.clock = env, Outcomes(env.num_agents), Clock()
        self._generator = torch.Generator().manual_seed(seed)
        self._networks: dict[str, nn.Module] = {}
        self._optimizers: dict[str, torch.optim.Optimizer | Descent] = {}
        self._generators: dict[str, torch.Generator] = {"generator": self._generator}
        self._arrays: dict[str, Array] = {"returns": self.outcomes.returns}

    def tensors(self) -> dict[str, Tensor]:
        """Return everything that the next rounds depend on, except the environment."""
        found = {
            f"{part}.{key}": value for part, net in self._networks.items() for key, value in net.state_dict().items()
        }
        for name, optimizer in self._optimizers.items():
            if isinstance(optimizer, Descent):
                found |= optimizer.tensors(name)
                continue
            for number, parts in optimizer.state_dict()["state"].items():
                found |= {f"{name}.{number}.{key}": value for key, value in parts.items()}
        found |= {name: generator.get_state() for name, generator in self._generators.items()}
        return found | {name: torch.from_numpy(values.copy()) for name, values in self._arrays.items()}

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Continue from :meth:`tensors`."""
        for part, net in self._networks.items():
            net.load_state_dict({key: tensors[f"{part}.{key}"] for key in net.state_dict()})
        for name, optimizer in self._optimizers.items():
            if isinstance(optimizer, Descent):
                optimizer.restore(name, tensors)
                continue
            state: dict[int, dict[str, Tensor]] = {}
            for key in [key for key in tensors if key.startswith(f"{name}.")]:
                _, number, part = key.rsplit(".", 2)
                state.setdefault(int(number), {})[part] = tensors[key].clone()
            optimizer.load_state_dict(optimizer.state_dict() | {"state": state})
        for name, generator in self._generators.items():
            generator.set_state(tensors[name])
        for name, values in self._arrays.items():
            values[:] = np.asarray(tensors[name])
