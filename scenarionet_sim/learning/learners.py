"""The algorithms by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, cast

from torch import Tensor

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.learning.config import LearnerConfig, PpoConfig
from scenarionet_sim.learning.ppo import PpoLearner
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


def make_learner(algorithm: str, env: FlatEnv, config: LearnerConfig, seed: int) -> Algorithm:
    """Return the learner of an algorithm in ``config.CONFIGS``."""
    made: Any = {"ppo": PpoLearner, "ippo": PpoLearner}[algorithm](env, cast("PpoConfig", config), seed)
    return cast("Algorithm", made)
