"""W worlds in one process that step as one batch, each with a scenario of its own: a Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.arena import ENDS, NUMBERS, Arena, open_stream
from scenarionet_sim.environments.config import VectorConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.environments.single_agent import action_space, configured
from scenarionet_sim.judging.task import ARRIVED, DRIVING, TIMED_OUT
from scenarionet_sim.worlds.world import World

Array = npt.NDArray[Any]
Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]

_LOADED_AHEAD = 8  # at most, by default: many worlds tend to end at once


class ScenarioNetVectorEnv(VectorEnv[Any, Array, Array]):
    """As ``ScenarioNetEnv``, W times in one batch.

    All slots draw from one series of scenarios, in the order of their resets; a curriculum counts the episodes of
    all. Autoreset is ``NEXT_STEP`` (the step after an episode's end ignores the action and returns the next
    episode's first observation) or ``SAME_STEP`` (the step that ends an episode returns it, and the last one as
    ``final_obs`` and ``final_info``). The environment pickles as its configuration and its last seed.

    Args:
        num_envs: W.
        config: What it is made of.
        autoreset_mode: When an episode follows on another.
        seed: Of the first series, when ``reset`` is called without one; None for a random one.
        settings: Fields of ``VectorConfig`` instead of ``config``.

    Example:
        envs = gymnasium.make_vec("ScenarioNet-v0", 64, scenarios=Scenarios("lake", "busy"))
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  # as the base class

    def __init__(
        self,
        num_envs: int = 1,
        config: VectorConfig | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        seed: int | None = None,
        **settings: Any,
    ) -> None:
        if num_envs < 1:
            raise BadParameter(f"wanted at least one world, found num_envs={num_envs}")
        self.config = configured(VectorConfig, config, settings)
        self._mode = AutoresetMode(autoreset_mode)
        if self._mode is AutoresetMode.DISABLED:
            raise BadParameter("autoreset_mode: wanted NEXT_STEP or SAME_STEP; worlds step together and reset alone")
        self.metadata = self.metadata | {"autoreset_mode": self._mode}
        self.num_envs = num_envs
        self._observation = Observation(self.config.sensors, self.config.observation)
        self.single_observation_space, self.single_action_space = self._observation.space, action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._stream = open_stream(self.config, min(self.config.ahead * num_envs, _LOADED_AHEAD))
        self._seed, self._is_fresh = seed, True
        self._arena: Arena | None = None
        self._scenario = np.zeros(num_envs, np.int64)
        self._has_ended = np.zeros(num_envs, np.bool_)

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetVectorEnv], tuple[Any, ...]]:
        return type(self), (self.num_envs, self.config, self._mode, self._seed)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every slot.

        Args:
            seed: Begins the series again; of several, the first counts, for there is one series.
            options: None are known.

        Raises:
            LakeError: A scenario cannot be read.
        """
        del options
        first = next(iter(seed), None) if isinstance(seed, Sequence) else seed
        if first is not None or self._is_fresh:
            self._restart(first)
        worlds = [self._next(slot) for slot in range(self.num_envs)]
        if self._arena is None:
            self._arena = Arena(self.config, self._observation, worlds)
            if len(self._arena.agents) != self.num_envs:
                raise BadParameter("one agent a world was expected; External(who=ego) drives the egos alone")
        for slot, world in enumerate(worlds):
            self._arena.begin(slot, world)
        self._has_ended[:] = False
        return self._arena.observe(self.np_random), self._infos()

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Float64, Bool, Bool, dict[str, Any]]:
        """Drive every world for one timestep.

        Args:
            actions: (W, 2) steering and throttle; those beyond [-1, 1] are clipped.

        Raises:
            ResetNeeded: No episode has begun.
            BadParameter: An action is not a number.
            LakeError: The next scenario cannot be read.
        """
        if self._arena is None:
            raise ResetNeeded("step needs episodes that run; call reset first")
        self._arena.step(actions)
        for slot in np.flatnonzero(self._has_ended):
            self._arena.begin(int(slot), self._next(int(slot)))
        rewards, status = self._arena.terms.sum(axis=1), self._arena.status
        terminated, truncated = (status != DRIVING) & (status != TIMED_OUT), status == TIMED_OUT
        ended = terminated | truncated
        for slot in np.flatnonzero(ended):
            self._stream.sampler.report(int(self._scenario[slot]), float(status[slot] == ARRIVED))
        observed, infos = self._arena.observe(self.np_random), self._infos()
        if self._mode is AutoresetMode.NEXT_STEP:
            self._has_ended = ended
        elif ended.any():
            infos = self._begin_others(ended, observed, infos)
        return observed, rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the thread and the physics."""
        del kwargs
        self._stream.close()
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

    def _restart(self, seed: int | None) -> None:
        """Begin the series again."""
        wanted = seed if seed is not None else self._seed
        self._np_random, found = seeding.np_random(None if wanted is None else int(wanted))
        self._np_random_seed = self._seed = int(found)
        self._stream.restart(self._seed)
        self._is_fresh = False

    def _next(self, slot: int) -> World:
        number, world = self._stream.next()
        self._scenario[slot] = number
        return world

    def _begin_others(self, ended: Bool, observed: Any, infos: dict[str, Any]) -> dict[str, Any]:
        """Put other scenarios in the slots whose episodes ended; changes what was observed there."""
        slots = np.flatnonzero(ended)
        last = np.full(self.num_envs, None, dtype=object)
        for slot, seen in zip(slots, self._observation.split(self._observation.take(observed, slots)), strict=True):
            last[slot] = seen
        for slot in slots:
            self.arena.begin(int(slot), self._next(int(slot)))
        self._observation.put(observed, slots, self.arena.observe(self.np_random, slots))
        final = {name: ended.copy() if name.startswith("_") else values for name, values in infos.items()}
        return self._infos() | {
            "final_obs": last, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended.copy(),
        }  # fmt: skip

    def _infos(self) -> dict[str, Any]:
        """What there is to know about every slot, as arrays (W,), each with a mask of where it is known."""
        arena, columns = self.arena, self.arena.numbers.copy()
        known: dict[str, Any] = {name: columns[:, number] for number, name in enumerate(NUMBERS)}
        known |= {name: arena.status == code for name, code in ENDS.items()}
        known["timestep"] = arena.simulation.state.timestep.copy()
        known["scenario_id"] = np.array([world.scenario_id for world in arena.simulation.stage.worlds], dtype=object)
        return known | {f"_{name}": np.ones(self.num_envs, np.bool_) for name in known}
