"""A Gymnasium vector environment: W worlds in one process, stepped as one batch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64, IntP, Object, UInt8, is_count
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.batched import INFOS, BatchedEnvironment
from scenarionet_sim.environments.config import VectorConfig, make_config, with_settings
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.environments.rendering import METADATA, Renderer, metadata_here
from scenarionet_sim.task.scoring_kernels import HAS_ARRIVED, TERMINATED, TRUNCATED, list_ended
from scenarionet_sim.threads.team import all_cores

_LOADED_AHEAD = 8  # many episodes tend to end in the same step


@with_settings(VectorConfig)
class ScenarioNetVectorEnv(VectorEnv[Any, Array, Array]):
    """``ScenarioNetEnv`` for W worlds in one batch.

    All slots draw from one series of scenarios, in the order of their resets; a curriculum counts all episodes.
    Autoreset is ``NEXT_STEP`` (the step after an episode's end ignores the action and returns the next
    episode's first observation) or ``SAME_STEP`` (the step that ends an episode returns it, and the last one as
    ``final_obs`` and ``final_info``). The environment pickles as its configuration and its last seed.

    Args:
        num_envs: W.
        config: Configuration.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP``.
        seed: Seed of the first series if ``reset`` gets none; None for a random one.
        render_mode: ``rgb_array`` or None.
        settings: Fields of ``VectorConfig`` instead of ``config``; an unknown one is a ``TypeError``.

    Example:
        envs = gymnasium.make_vec("ScenarioNet-v0", 64, scenarios=Scenarios("lake", "busy"))
    """

    metadata: dict[str, Any] = METADATA | {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        config: VectorConfig | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        seed: int | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ) -> None:
        if not is_count(num_envs, 1):
            raise BadParameter(f"num_envs={num_envs!r}; expected at least 1")
        self.config = make_config(VectorConfig, config, settings)
        self._mode = AutoresetMode(autoreset_mode)
        if self._mode is AutoresetMode.DISABLED:
            raise BadParameter("autoreset_mode: expected NEXT_STEP or SAME_STEP; single worlds cannot wait for a reset")
        if render_mode not in (None, "rgb_array"):
            raise BadParameter(f"render_mode={render_mode!r} of {num_envs} worlds; expected 'rgb_array' or None")
        self.render_mode, self._renderer = render_mode, Renderer(render_mode)
        modes = [mode for mode in metadata_here()["render_modes"] if mode == "rgb_array"]
        self.metadata = self.metadata | {"autoreset_mode": self._mode, "render_modes": modes}
        self.num_envs = num_envs
        prefetch = min(self.config.prefetch * num_envs, _LOADED_AHEAD)
        self._episodes = Episodes(self.config, seed, num_envs, prefetch, self.config.threads or all_cores())
        self.single_observation_space, self.single_action_space = self._episodes.observation.space, action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._ended: IntP = _NONE  # slots that begin another episode in the next step
        self._places: Int64 = np.zeros(num_envs, np.int64)  # of which ``_ended`` is a part
        self._ids: Object = np.array(self._episodes.ids, dtype=object)
        self._scenario_ids = np.full(num_envs, "", dtype=object)
        everywhere = np.ones(num_envs, np.bool_)
        everywhere.flags.writeable = False  # one array for all infos
        self._masks = {f"_{name}": everywhere for name in INFOS}

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetVectorEnv], tuple[Any, ...]]:
        return type(self), (self.num_envs, self.config, self._mode, self._episodes.seed, self.render_mode)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode in every slot.

        Args:
            seed: Restarts the series; of several, the first is used, since all slots share one series.
            options: None; Gymnasium's interface has it.

        Raises:
            BadParameter: There are options: a batch plays its scenarios in order.
            LakeError: A scenario cannot be read.
        """
        if options:
            raise BadParameter(
                f"options={options!r}; a batch has no options, expected None: choose scenarios by "
                "scenarios=Scenarios(lake, ids), or play one from a timestep in ScenarioNetEnv"
            )
        first = next(iter(seed), None) if isinstance(seed, Sequence) else seed
        if self._episodes.restart(first):
            self._np_random, self._np_random_seed = self._episodes.rng, self._episodes.seed
        slots = np.arange(self.num_envs)
        self._episodes.begin(slots, self._episodes.draw_all(slots))
        self._note_begun()
        self._ended = _NONE
        return self._observed(), self._infos()

    def step(self, actions: npt.ArrayLike) -> tuple[Any, Float64, Bool, Bool, dict[str, Any]]:
        """Drive every world for one timestep.

        Args:
            actions: (W, 2) steering and throttle, clipped to [-1, 1].

        Raises:
            ResetNeeded: No episode has begun.
            BadParameter: An action is not finite.
            LakeError: The next scenario cannot be read.
        """
        core = self.core
        if len(self._ended):
            self._begin_next(self._ended, in_step=True)
            self._ended = _NONE  # also if the actions turn out to be invalid
        core.step_by_place(actions)
        result = core.result
        self._ended = self._places[: list_ended(result.status, self._places)]
        if self._episodes.is_adaptive:
            for slot in self._ended.tolist():
                self._episodes.report(slot, float(result.flags[HAS_ARRIVED, slot]))
        observed, infos = self._observed(), self._infos()
        results = result.rewards, result.flags[TERMINATED], result.flags[TRUNCATED]
        if len(self._ended) and self._mode is AutoresetMode.SAME_STEP:
            observed, infos = self._begin_others(observed, infos)
        return observed, *results, infos

    def render(self) -> tuple[UInt8, ...] | None:
        """Return an image (H, W, 3) uint8 of each world from above, centred on its ego; None without a render mode.

        Raises:
            ResetNeeded: ``reset`` was not called yet.
            MissingDependency: matplotlib is not installed.
        """
        return self._renderer.pictures(self.core, self.num_envs)

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the thread and the physics."""
        del kwargs
        self._episodes.close()
        self._renderer.close()

    @property
    def core(self) -> BatchedEnvironment:
        """The simulated worlds and their agents.

        Raises:
            ResetNeeded: ``reset`` was not called yet.
        """
        return self._episodes.core

    def _begin_next(self, slots: IntP, *, in_step: bool) -> None:
        """Begin the next scenarios in some slots."""
        self._episodes.begin_next(slots, in_step=in_step)
        self._note_begun()

    def _note_begun(self) -> None:
        """Note the scenarios of all slots: with one agent each.

        Raises:
            BadParameter: A world may have several agents.
        """
        if self.core.simulation.by_place.num_places != self.num_envs:
            raise BadParameter("expected one agent per world; use External(objects=ego) to drive the egos alone")
        self._scenario_ids = self._ids.take(self._episodes.playing)  # earlier infos have the array from before

    def _observed(self) -> Any:
        return self.core.observe_by_place(self._episodes.rng)

    def _begin_others(self, last_seen: Any, infos: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """Begin the next scenarios in the slots that ended; return the observations and infos."""
        slots, last = self._ended, np.full(self.num_envs, None, dtype=object)
        observation = self._episodes.observation
        for slot, seen in zip(slots, observation.split(observation.take(last_seen, slots)), strict=True):
            last[slot] = seen
        self._begin_next(slots, in_step=False)
        self._ended = _NONE
        observed = self.core.observe_by_place(self._episodes.rng, slots)
        ended = np.zeros(self.num_envs, np.bool_)
        ended[slots] = True
        final = {name: ended.copy() if name.startswith("_") else values for name, values in infos.items()}
        return observed, self._infos() | {
            "final_obs": last, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended,
        }  # fmt: skip

    def _infos(self) -> dict[str, Any]:
        """Return the infos of all slots as arrays (W,), each with a mask."""
        return {**self.core.named_result, "scenario_id": self._scenario_ids, **self._masks}


_NONE: IntP = np.zeros(0, np.intp)
