"""A Stable-Baselines3 ``VecEnv`` of W worlds in one process; needs the package ``stable-baselines3``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

from scenarionet_data.arrays.dtypes import Array, Bool, Float32
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.config import VectorConfig
from scenarionet_sim.environments.flat import FlatEnv


class StableBaselinesEnv(VecEnv):  # type: ignore[misc]  # Stable-Baselines3 is optional
    """W worlds with one agent each; the next scenario begins in the step that ends an episode.

    Returned arrays are copies, since algorithms of Stable-Baselines3 keep the last observations. The info of an
    episode's last step has ``terminal_observation``, ``TimeLimit.truncated`` and ``is_success``.

    Args:
        num_worlds: W.
        config: Configuration.
        seed: Seed of the series of scenarios; None for a random one.
        threads: Largest number of threads; 0 for all cores.

    Example:
        PPO("MlpPolicy", StableBaselinesEnv(64, VectorConfig(Scenarios("lake", "busy")))).learn(1_000_000)
    """

    def __init__(self, num_worlds: int, config: VectorConfig, seed: int | None = None, threads: int = 0) -> None:
        self._flat = FlatEnv(num_worlds, config, seed=seed, threads=threads)
        self.render_mode: str | None = None
        super().__init__(num_worlds, self._flat.single_observation_space, self._flat.single_action_space)
        self._next_seed: int | None = None
        self._given: npt.ArrayLike = np.zeros((num_worlds, 2))

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Restart the series of scenarios with a seed in the next reset."""
        self._next_seed = seed
        return [seed] * self.num_envs

    def reset(self) -> Array:
        """Begin an episode in every world."""
        observations, _ = self._flat.reset(self._next_seed)
        self._next_seed = None
        return observations.copy()

    def step_async(self, actions: npt.ArrayLike) -> None:
        """Take the actions (W, 2) of the next step."""
        self._given = actions

    def step_wait(self) -> tuple[Float32, Float32, Bool, list[dict[str, Any]]]:
        """Drive for one timestep."""
        flat = self._flat
        observations, rewards, terminals, truncations, ended = flat.step(self._given)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for info in ended:
            slot = info["slot"]
            infos[slot] = info | {
                "terminal_observation": flat.last_observations[slot].copy(),
                "TimeLimit.truncated": bool(truncations[slot]),
                "is_success": info["success"] > 0.0,
            }
        return observations.copy(), rewards.copy(), terminals | truncations, infos

    def close(self) -> None:
        """Stop the threads and the physics."""
        self._flat.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute once for each world; worlds have none of their own."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: the worlds share one environment.

        Raises:
            BadParameter: Always.
        """
        del value, indices
        raise BadParameter(f"set_attr({attr_name!r}): worlds of StableBaselinesEnv cannot differ; change its config")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Refuse: worlds have no methods of their own.

        Raises:
            BadParameter: Always.
        """
        del method_args, indices, method_kwargs
        raise BadParameter(f"env_method({method_name!r}): worlds of StableBaselinesEnv have no methods")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no world is wrapped."""
        del wrapper_class
        return [False] * len(list(self._get_indices(indices)))
