"""``ScenarioNet-MultiAgent-v0``: a PettingZoo parallel environment in which every vehicle is an agent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NoReturn, cast

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import MultiAgentConfig, make_config, with_settings
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.environments.rendering import METADATA, Renderer, metadata_here
from scenarionet_sim.policies.external import External
from scenarionet_sim.task.task import ARRIVED, DRIVING, TIMED_OUT

try:
    from pettingzoo import ParallelEnv
except FileNotFoundError as error:  # it reads the files of all its games to list them
    gone = f"environments of many agents need all files of pettingzoo; there is no {error.filename}"
    raise MissingDependency(gone, "", "pip install --force-reinstall pettingzoo") from error

Named = dict[str, Any]


@with_settings(MultiAgentConfig)
class ScenarioNetParallelEnv(ParallelEnv[str, Any, Array]):  # type: ignore[misc]  # PettingZoo is not typed
    """One recorded scenario per episode; vehicles appear as recorded and leave when they arrive.

    An agent is named by its track id. It appears at its first recorded timestep, is in the returned dictionaries from
    then on, and is removed when it reaches the end of its recorded route or is too far from it. It stays after a
    crash. Timesteps without an agent are skipped while one is still to appear.

    Every agent has the same spaces. Actions, ``reset`` and pickling are as in ``ScenarioNetEnv``.

    Args:
        config: Configuration.
        render_mode: ``rgb_array``, ``human`` or None.
        seed: Seed of the first series if ``reset`` gets none; None for a random one.
        settings: Fields of ``MultiAgentConfig`` instead of ``config``; an unknown one is a ``TypeError``.

    Attributes:
        agents: Agents that act in the next step.
        possible_agents: All agents of the current scenario.
    """

    metadata = METADATA | {"name": "ScenarioNet-MultiAgent-v0", "is_parallelizable": True}

    def __init__(
        self,
        config: MultiAgentConfig | None = None,
        render_mode: str | None = None,
        seed: int | None = None,
        **settings: Any,
    ) -> None:
        self.config = make_config(MultiAgentConfig, config, settings)
        self.render_mode, self._renderer = render_mode, Renderer(render_mode)
        self.metadata = self.metadata | metadata_here()
        self._episodes = Episodes(self.config, seed)
        self._action_space = action_space()
        self.agents: list[str] = []
        self.possible_agents: list[str] = []
        self._named_rows: Int32 | None = None

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetParallelEnv], tuple[Any, ...]]:
        return type(self), (self.config, self.render_mode, self._episodes.seed)

    def observation_space(self, agent: str) -> spaces.Space[Any]:  # noqa: ARG002
        """Observation space, the same for all agents."""
        return self._episodes.observation.space

    def action_space(self, agent: str) -> spaces.Box:  # noqa: ARG002
        """Steering and throttle, the same for all agents."""
        return self._action_space

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Named, Named]:
        """Begin an episode; see ``ScenarioNetEnv.reset``.

        Returns:
            Observations and infos by agent; empty for a scenario without travelling vehicles.
        """
        self._episodes.restart(seed)
        if isinstance(options, dict) and options == {"options": 1}:  # by which PettingZoo tests the interface
            options = None
        world, timestep = self._episodes.chosen(options)
        core = self._episodes.prepare([world])
        core.begin([0], [world], timestep)
        driver, simulation = core.simulation.driver[0, : world.num_objects], core.simulation
        numbers = [number for number, policy in enumerate(simulation.policies) if isinstance(policy, External)]
        appears = world.log_valid[int(simulation.state.timestep[0]) :].any(axis=0)  # now or later
        self.possible_agents = list(map(str, world.track_ids[np.isin(driver, numbers) & appears]))
        self._coming, self._num_arrived = set(self.possible_agents), 0
        self._named_rows = None
        self._wait(core)
        if self._renderer.is_window:
            self._renderer.render(core)
        return self._named(self._seen()), self._named(core.infos())

    def step(self, actions: Mapping[str, npt.ArrayLike]) -> tuple[Named, Named, Named, Named, Named]:
        """Drive for one timestep.

        Args:
            actions: (2,) steering and throttle for every agent in ``agents``.

        Returns:
            Observations, rewards, terminations, truncations and infos of the agents that acted or appeared.

        Raises:
            ResetNeeded: No agent is left, or no episode has begun.
            BadParameter: An agent has no action, there is an action for an unknown agent, or one is not finite.
        """
        if not self.agents:
            raise ResetNeeded("no agent is left; call reset first")
        if not isinstance(actions, Mapping):
            raise BadParameter(f"actions={actions!r}; expected {{agent: (steering, throttle)}} of env.agents")
        if actions.keys() != set(self.agents):
            wrong = sorted(actions.keys() ^ set(self.agents))
            raise BadParameter(
                f"actions must have one entry per agent in env.agents; {wrong[0]!r} is missing or unknown"
            )
        core = self.core
        core.step(cast(npt.ArrayLike, [actions[agent] for agent in self.agents]))
        self._name_agents(core)
        status = core.status
        ended, is_late = status != DRIVING, status == TIMED_OUT
        values = self._seen(), core.rewards.tolist(), (ended & ~is_late).tolist(), is_late.tolist(), core.infos()
        observations, rewards, terminated, truncated, infos = map(self._named, values)
        if ended.any():
            self._num_arrived += int((status == ARRIVED).sum())
            core.retire(np.flatnonzero(ended))
            self._wait(core)
            late = set(self.agents) - observations.keys()  # appeared during skipped timesteps
            if late:
                observations |= {agent: seen for agent, seen in self._named(self._seen()).items() if agent in late}
                infos |= {agent: info for agent, info in self._named(core.infos()).items() if agent in late}
            rewards |= dict.fromkeys(late, 0.0)
            terminated |= dict.fromkeys(late, False)
            truncated |= dict.fromkeys(late, False)
        if self._renderer.is_window:
            self._renderer.render(core)
        return observations, rewards, terminated, truncated, infos

    def render(self) -> Any:
        """Render as ``ScenarioNetEnv.render``, centred on the recording vehicle."""
        return self._renderer.render(self.core)

    def close(self) -> None:
        """Stop the thread, the physics and the window; ``reset`` starts them again."""
        self.agents = []
        self._episodes.close()
        self._renderer.close()

    @property
    def core(self) -> BatchedEnvironment:
        """The simulated world and its agents.

        Raises:
            ResetNeeded: ``reset`` was not called yet.
        """
        return self._episodes.core

    def _wait(self, core: BatchedEnvironment) -> None:
        """Skip timesteps until an agent is present; without any to come, the episode is over."""
        self._name_agents(core)
        while not self.agents and self._coming:
            core.step(np.zeros((0, 2)))
            self._name_agents(core)
        if not self.agents and self.possible_agents:
            self._episodes.report(0, self._num_arrived / len(self.possible_agents))

    def _name_agents(self, core: BatchedEnvironment) -> None:
        """Name the present agents, if they are others than last."""
        if self._named_rows is core.agents:
            return
        (world,), self._named_rows = core.simulation.batch.worlds, core.agents
        self.agents = list(map(str, world.track_ids[core.agents[:, 1]]))
        self._coming.difference_update(self.agents)

    def _seen(self) -> list[Any]:
        return self._episodes.observed()

    def _named(self, values: list[Any]) -> Named:
        return dict(zip(self.agents, values, strict=True))


def not_for_gymnasium(**settings: Any) -> NoReturn:
    """Say how to make the environment: Gymnasium's ``make`` returns environments of one agent only.

    Raises:
        BadParameter: Always.
    """
    given = ", ".join(f"{name}=..." for name in settings) or "scenarios=..."
    raise BadParameter(
        "ScenarioNet-MultiAgent-v0 is an environment of PettingZoo, which gymnasium.make cannot return; make it with "
        f"scenarionet_sim.ScenarioNetParallelEnv({given})"
    )
