"""The algorithms by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, cast

from torch import Tensor

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.learning.airl import AirlLearner
from scenarionet_sim.learning.config import AirlConfig, CopoConfig, GailConfig, LearnerConfig, PpoConfig, Td3Config
from scenarionet_sim.learning.copo import CopoLearner
from scenarionet_sim.learning.experts import Experts
from scenarionet_sim.learning.gail import GailLearner
from scenarionet_sim.learning.ppo import PpoLearner
from scenarionet_sim.learning.rows import Clock, Outcomes
from scenarionet_sim.learning.td3 import Td3Learner


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


def make_learner(algorithm: str, env: FlatEnv, config: LearnerConfig, seed: int, experts: Experts | None) -> Algorithm:
    """Return the learner of an algorithm in ``config.CONFIGS``.

    Args:
        algorithm: Its name.
        env: Where the agents drive; it has been reset.
        config: Its settings.
        seed: Seed of weights, actions and minibatches.
        experts: Transitions of experts, for imitation.

    Raises:
        BadParameter: Experts are needed and missing.
    """
    if isinstance(config, GailConfig):
        if experts is None:
            raise BadParameter(
                f"{algorithm} imitates experts; pass observations='NAME' of a run of scenarionet_sim.record",
                cli_remedy="--observations NAME of a run of `scenarionet runs record`",
            )
        return (AirlLearner if isinstance(config, AirlConfig) else GailLearner)(env, config, seed, experts)  # type: ignore[arg-type]
    if isinstance(config, Td3Config):
        return Td3Learner(env, config, seed)
    if isinstance(config, CopoConfig):
        return CopoLearner(env, config, seed, env.seats)
    return PpoLearner(env, cast("PpoConfig", config), seed)
