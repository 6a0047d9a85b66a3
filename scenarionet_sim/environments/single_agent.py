"""``ScenarioNet-v0``: one agent drives the ego of recorded scenarios, as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.arena import Arena, open_stream
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.environments.view import METADATA, View
from scenarionet_sim.judging.task import ARRIVED, DRIVING, TIMED_OUT
from scenarionet_sim.worlds.world import World

Array = npt.NDArray[Any]


def action_space() -> spaces.Box:
    """Steering (positive to the left) and throttle (negative: brake)."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


class ScenarioNetEnv(gymnasium.Env[Any, Array]):
    """One recorded scenario an episode: reach the end of the ego's recorded route.

    Actions beyond [-1, 1] are clipped; one that is not a number is an error. ``info`` has every term of the reward
    (they add up to it), how the episode ended, and what ``Arena.infos`` lists besides.

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
        self.config = configured(EnvConfig, config, settings)
        self.render_mode, self._view = render_mode, View(render_mode)
        self._observation = Observation(self.config.sensors, self.config.observation)
        self.observation_space = self._observation.space
        self.action_space = action_space()
        self._stream = open_stream(self.config, self.config.ahead)
        self._seed, self._is_fresh = seed, True
        self._arena: Arena | None = None
        self._is_running = False

    def __len__(self) -> int:
        """Number of scenarios that are played."""
        return len(self._stream.ids)

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetEnv], tuple[Any, ...]]:
        return type(self), (self.config, self.render_mode, self._seed)

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
        if seed is not None or self._is_fresh:
            self._seed = seed if seed is not None else self._seed
            super().reset(seed=self._seed)
            self._seed = int(self.np_random_seed) if self._seed is None else self._seed
            self._stream.restart(self._seed)
            self._is_fresh = False
        world, start = self._next(options or {})
        self._begin(world, start)
        self._is_running = True
        self._view.follow(self.arena)
        return self._observe(), self._info()

    def render(self) -> Any:
        """The moment from above: a picture (H, W, 3) uint8 for ``rgb_array``, a window for ``human``.

        Raises:
            ResetNeeded: There was no reset yet.
            MissingDependency: matplotlib is not installed.
        """
        return self._view.render(self.arena)

    def step(self, action: npt.ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one timestep.

        Args:
            action: (2,) steering and throttle.

        Raises:
            ResetNeeded: The episode is over, or none has begun.
            BadParameter: The action is not a number.
        """
        if not self._is_running or self._arena is None:
            raise ResetNeeded("step needs an episode that runs; call reset first")
        if np.shape(action) != (2,):
            raise BadParameter(f"an action of shape {np.shape(action)}; wanted steering and throttle, shape (2,)")
        self._arena.step(action)
        status = self._arena.status[0]
        if status != DRIVING:
            self._is_running = False
            self._stream.sampler.report(self._index, float(status == ARRIVED))
        is_over, is_late = status not in (DRIVING, TIMED_OUT), status == TIMED_OUT
        self._view.follow(self._arena)
        return self._observe(), float(self._arena.terms.sum()), bool(is_over), bool(is_late), self._info()

    def close(self) -> None:
        """End the thread, the physics and the window; reset starts them again."""
        self._is_running = False
        self._stream.close()
        self._view.close()
        if self._arena is not None:
            self._arena.close()
            self._arena = None

    @property
    def arena(self) -> Arena:
        """The worlds inside, for who wants to look deeper.

        Raises:
            ResetNeeded: There was no reset yet.
        """
        if self._arena is None:
            raise ResetNeeded("there is no world yet; call reset first")
        return self._arena

    def _next(self, options: dict[str, Any]) -> tuple[World, int | None]:
        """The world to play, and the log's timestep at which to begin."""
        if "scenario_id" in options:
            self._index = self._stream.number(options["scenario_id"])
            return self._stream.get(self._index), options.get("timestep")
        self._index, world = self._stream.next()
        return world, options.get("timestep")

    def _begin(self, world: World, start: int | None) -> None:
        if self._arena is not None and not self._arena.can_play(world):
            self._arena.close()
            self._arena = None
        if self._arena is None:
            self._arena = Arena(self.config, self._observation, [world])
            if len(self._arena.agents) != 1:
                raise BadParameter("one agent was expected; External(who=ego) drives the ego alone")
        self._arena.begin(0, world, start)

    def _observe(self) -> Any:
        return self._observation.split(self.arena.observe(self.np_random))[0]

    def _info(self) -> dict[str, Any]:
        return self.arena.infos()[0]


def configured(kind: type[Any], config: EnvConfig | None, settings: dict[str, Any]) -> Any:
    """A configuration given whole or by its fields.

    Raises:
        BadParameter: Both or neither are given, or a field is unknown.
    """
    if config is not None and settings:
        raise BadParameter(f"give config or its fields, not both; found {', '.join(settings)} beside config")
    if config is None and "scenarios" not in settings:
        raise BadParameter("an environment needs scenarios=Scenarios('lake', 'database')")
    known = kind.__dataclass_fields__
    unknown = [name for name in settings if name not in known]
    if unknown:
        raise BadParameter(f"no setting {unknown[0]!r}; there are {', '.join(known)}")
    return kind(**settings) if config is None else config
