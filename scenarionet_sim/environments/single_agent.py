"""``ScenarioNet-v0``: a Gymnasium environment in which one agent drives the ego of recorded scenarios."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import as_numbers
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import EnvConfig, make_config, with_settings
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.environments.rendering import METADATA, Renderer, metadata_here
from scenarionet_sim.task.task import ARRIVED, DRIVING, TIMED_OUT


@with_settings(EnvConfig)
class ScenarioNetEnv(gymnasium.Env[Any, Array]):
    """One recorded scenario per episode: drive to the end of the ego's recorded route.

    Actions are clipped to [-1, 1]; NaN is an error. ``info`` contains the terms of the reward (they add up to it), how
    the episode ended, and the running statistics of ``BatchedEnvironment.infos``.

    ``reset(seed=...)`` restarts the series of scenarios, including a curriculum's progress; ``reset()`` continues it;
    ``reset(options={"scenario_id": ..., "timestep": ...})`` plays a given scenario from a timestep of its log.

    The environment pickles as its configuration and last seed.

    Args:
        config: Configuration.
        render_mode: ``rgb_array``, ``human`` or None.
        seed: Seed of the first series if ``reset`` gets none; None for a random one.
        settings: Fields of ``EnvConfig`` instead of ``config``; an unknown one is a ``TypeError``.

    Example:
        env = gymnasium.make("ScenarioNet-v0", scenarios=Scenarios("lake", "busy"), backend=Kinematic())
    """

    metadata = METADATA

    def __init__(
        self, config: EnvConfig | None = None, render_mode: str | None = None, seed: int | None = None, **settings: Any
    ) -> None:
        self.config = make_config(EnvConfig, config, settings)
        self.render_mode, self._renderer = render_mode, Renderer(render_mode)
        self.metadata = self.metadata | metadata_here()
        self._episodes = Episodes(self.config, seed)
        self.observation_space = self._episodes.observation.space
        self.action_space = action_space()
        self._is_running = False

    def __len__(self) -> int:
        """Number of selected scenarios."""
        return len(self._episodes.ids)

    @property
    def scenario_ids(self) -> list[str]:
        """Ids of the selected scenarios, in order."""
        return list(self._episodes.ids)

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetEnv], tuple[Any, ...]]:
        return type(self), (self.config, self.render_mode, self._episodes.seed)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Restarts the series.
            options: ``scenario_id`` and ``timestep``, each optional.

        Raises:
            BadParameter: An option is unknown, or the ego is not valid at the timestep.
            ScenarioNotFound: The id is not among the selected scenarios.
            LakeError: The scenario cannot be read; the next reset continues with the one after it.
        """
        self._is_running = False
        if self._episodes.restart(seed):
            self._np_random, self._np_random_seed = self._episodes.rng, self._episodes.seed
        world, timestep = self._episodes.chosen(options)
        core = self._episodes.prepare([world])
        if core.simulation.by_place.num_places != 1:
            raise BadParameter("expected one agent; use External(objects=ego) to drive the ego alone")
        core.begin([0], [world], timestep)
        self._is_running = True
        if self._renderer.is_window:
            self._renderer.render(core)
        return self._observed(core), self._info(core)

    def render(self) -> Any:
        """Render a top-down view: an image (H, W, 3) uint8 for ``rgb_array``, a window for ``human``.

        Raises:
            ResetNeeded: ``reset`` was not called yet.
            MissingDependency: matplotlib is not installed.
        """
        return self._renderer.render(self.core)

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one timestep.

        Args:
            action: (2,) steering and throttle.

        Raises:
            ResetNeeded: The episode is over, or none has begun.
            BadParameter: The action has another shape or is NaN.
        """
        if not self._is_running:
            raise ResetNeeded("no episode is running; call reset first")
        given = as_numbers(action)
        if given.shape != (2,):
            raise BadParameter(f"action of shape {given.shape}; expected steering and throttle, shape (2,)")
        core = self.core
        core.step_by_place(given.reshape(1, 2))
        status = core.result.status.item(0)
        if status != DRIVING:
            self._is_running = False
            self._episodes.report(0, float(status == ARRIVED))
        is_over, is_late = status not in (DRIVING, TIMED_OUT), status == TIMED_OUT
        if self._renderer.is_window:
            self._renderer.render(core)
        return self._observed(core), core.result.rewards.item(0), is_over, is_late, self._info(core)

    def _observed(self, core: BatchedEnvironment) -> Any:
        """Return the observation of the agent, in arrays that later steps leave alone."""
        (observed,) = self._episodes.observation.split(core.observe_by_place(self._episodes.rng))
        return observed

    def _info(self, core: BatchedEnvironment) -> dict[str, Any]:
        info = {name: values.item(0) for name, values in core.named_result.items()}
        return info | {"scenario_id": core.simulation.batch.worlds[0].scenario_id}

    def __repr__(self) -> str:
        return f"ScenarioNetEnv({len(self)} scenarios, {self.config!r})"

    def close(self) -> None:
        """Stop the thread, the physics and the window; ``reset`` starts them again."""
        self._is_running = False
        self._episodes.close()
        self._renderer.close()

    @property
    def core(self) -> BatchedEnvironment:
        """The simulated worlds and their agents.

        Raises:
            ResetNeeded: ``reset`` was not called yet.
        """
        return self._episodes.core
