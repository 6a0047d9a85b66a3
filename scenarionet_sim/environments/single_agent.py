"""``ScenarioNet-v0``: one agent drives the ego of recorded scenarios, as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import EnvConfig, make_config
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.environments.view import METADATA, View
from scenarionet_sim.task.task import ARRIVED, DRIVING, TIMED_OUT


class ScenarioNetEnv(gymnasium.Env[Any, Array]):
    """One recorded scenario an episode: reach the end of the ego's recorded route.

    Actions beyond [-1, 1] are clipped; one that is not a number is an error. ``info`` has every term of the reward
    (they add up to it), how the episode ended, and what ``BatchedEnvironment.infos`` lists besides.

    ``reset(seed=...)`` begins the series of scenarios again, a curriculum's progress included; ``reset()`` goes on
    in it; ``reset(options={"scenario_id": ...})`` plays a certain one, ``"timestep"`` of the log being where it begins.

    The environment pickles as its configuration and its last seed.

    Args:
        config: What it is made of.
        render_mode: ``rgb_array``, ``human`` or None.
        seed: Of the first series, when ``reset`` is called without one; None for a random one.
        settings: Fields of ``EnvConfig`` instead of ``config``.

    Example:
        env = gymnasium.make("ScenarioNet-v0", scenarios=Scenarios("lake", "busy"), backend=Kinematic())
    """

    metadata = METADATA

    def __init__(
        self, config: EnvConfig | None = None, render_mode: str | None = None, seed: int | None = None, **settings: Any
    ) -> None:
        self.config = make_config(EnvConfig, config, settings)
        self.render_mode, self._view = render_mode, View(render_mode)
        self._episodes = Episodes(self.config, seed)
        self.observation_space = self._episodes.observation.space
        self.action_space = action_space()
        self._is_running = False

    def __len__(self) -> int:
        """Number of scenarios that are played."""
        return len(self._episodes.ids)

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetEnv], tuple[Any, ...]]:
        return type(self), (self.config, self.render_mode, self._episodes.seed)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Begins the series again.
            options: ``scenario_id`` and ``timestep``, each optional.

        Raises:
            ScenarioNotFound: No such scenario among those chosen.
            LakeError: The scenario cannot be read; the next reset goes on with the one after it.
        """
        self._is_running = False
        if self._episodes.restart(seed):
            self._np_random, self._np_random_seed = self._episodes.rng, self._episodes.seed
        options = options or {}
        world = self._episodes.draw(scenario_id=options.get("scenario_id"))
        core = self._episodes.prepare([world])
        if len(core.agents) != 1:
            raise BadParameter("one agent was expected; External(objects=ego) drives the ego alone")
        core.begin(0, world, options.get("timestep"))
        self._is_running = True
        self._view.follow(core)
        return self._observe(), core.infos()[0]

    def render(self) -> Any:
        """The moment from above: a picture (H, W, 3) uint8 for ``rgb_array``, a window for ``human``.

        Raises:
            ResetNeeded: There was no reset yet.
            MissingDependency: matplotlib is not installed.
        """
        return self._view.render(self.core)

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one timestep.

        Args:
            action: (2,) steering and throttle.

        Raises:
            ResetNeeded: The episode is over, or none has begun.
            BadParameter: The action is not a number.
        """
        if not self._is_running:
            raise ResetNeeded("step needs an episode that runs; call reset first")
        if np.shape(action) != (2,):
            raise BadParameter(f"an action of shape {np.shape(action)}; wanted steering and throttle, shape (2,)")
        core = self.core
        core.step(action)
        status = core.status[0]
        if status != DRIVING:
            self._is_running = False
            self._episodes.report(0, float(status == ARRIVED))
        is_over, is_late = status not in (DRIVING, TIMED_OUT), status == TIMED_OUT
        self._view.follow(core)
        return self._observe(), float(core.rewards[0]), bool(is_over), bool(is_late), core.infos()[0]

    def close(self) -> None:
        """End the thread, the physics and the window; reset starts them again."""
        self._is_running = False
        self._episodes.close()
        self._view.close()

    @property
    def core(self) -> BatchedEnvironment:
        """The worlds inside, for who wants to look deeper.

        Raises:
            ResetNeeded: There was no reset yet.
        """
        return self._episodes.core

    def _observe(self) -> Any:
        return self._episodes.observation.split(self._episodes.observe())[0]
