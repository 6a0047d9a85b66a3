"""What an algorithm is, and the learner that its settings name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from torch import Tensor

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.errors import BadParameter
from scenarionet_data.public_names import load_by_name
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.learning.config import LearnerConfig
from scenarionet_sim.learning.experts import Experts
from scenarionet_sim.learning.rows import Clock, Outcomes


class Algorithm(Protocol):
    """An algorithm that learns in rounds."""

    outcomes: Outcomes
    clock: Clock

    @property
    def num_bytes(self) -> int:
        """Memory of the experience."""

    def round(self) -> tuple[int, dict[str, float]]:
        """Collect experience and learn; return the steps of agents, and numbers by name."""

    def mode(self, observations: Float32) -> Float32:
        """Return the controls (B, 2) of the policy for observations (B, D), without chance."""

    def tensors(self) -> dict[str, Tensor]:
        """Return everything that the next rounds depend on, except the environment."""

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Continue from :meth:`tensors`."""


def make_learner(env: FlatEnv, config: LearnerConfig, seed: int, experts: Experts | None) -> Algorithm:
    """Return the learner that the settings name.

    Args:
        env: Where the agents drive; it has been reset.
        config: The settings.
        seed: Seed of weights, actions and minibatches.
        experts: Transitions of experts, for imitation.

    Raises:
        BadParameter: Experts are needed and missing, or the learner cannot be imported.
    """
    if config.needs_experts and experts is None:
        raise BadParameter(
            f"{type(config).__name__} imitates experts; pass observations='NAME' of a run of scenarionet_sim.record",
            cli_remedy="--observations NAME of a run of `scenarionet runs record`",
        )
    learner: Algorithm = load_by_name(config.learner)(env, config, seed, *([experts] if config.needs_experts else []))
    return learner
