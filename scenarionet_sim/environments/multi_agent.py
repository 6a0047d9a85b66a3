"""``ScenarioNet-MultiAgent-v0``: every vehicle of a scenario is an agent, as a PettingZoo parallel environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from pettingzoo import ParallelEnv

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import MultiAgentConfig, make_config
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.environments.view import METADATA, View
from scenarionet_sim.policies import External
from scenarionet_sim.task.task import ARRIVED
from scenarionet_sim.worlds.world import World

Named = dict[str, Any]


class ScenarioNetParallelEnv(ParallelEnv[str, Any, Array]):  # type: ignore[misc]  # PettingZoo is not typed
    """One recorded scenario an episode, whose vehicles come as they were recorded and go when they have arrived.

    An agent is named by its track. It appears at its first recorded timestep, is in the returned dictionaries from
    then on, and is taken out of the scenario when it has reached the end of its recorded route, or is too far from
    it. It stays when it crashes. Timesteps at which no agent is there, but one is to come, pass by themselves.

    Every agent has the same spaces. Actions, ``reset`` and pickling are as in ``ScenarioNetEnv``.

    Args:
        config: What it is made of.
        render_mode: ``rgb_array``, ``human`` or None.
        seed: Of the first series, when ``reset`` is called without one; None for a random one.
        settings: Fields of ``MultiAgentConfig`` instead of ``config``.

    Attributes:
        agents: Those that act in the next step.
        possible_agents: Those of the scenario that was reset last.
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
        self.render_mode, self._view = render_mode, View(render_mode)
        self._episodes = Episodes(self.config, seed)
        self._action_space = action_space()
        self.agents: list[str] = []
        self.possible_agents: list[str] = []

    def __reduce__(self) -> tuple[Callable[..., ScenarioNetParallelEnv], tuple[Any, ...]]:
        return type(self), (self.config, self.render_mode, self._episodes.seed)

    def observation_space(self, agent: str) -> spaces.Space[Any]:  # noqa: ARG002
        """What an agent observes; the same for all."""
        return self._episodes.observation.space

    def action_space(self, agent: str) -> spaces.Box:  # noqa: ARG002
        """Steering and throttle; the same for all."""
        return self._action_space

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Named, Named]:
        """Begin an episode; see ``ScenarioNetEnv.reset``.

        Returns:
            Observations and infos by agent; empty for a scenario without a vehicle that drives.
        """
        self._episodes.restart(seed)
        options = options or {}
        world = self._episodes.draw(scenario_id=options.get("scenario_id"))
        core = self._episodes.prepare([world])
        core.begin(0, world, options.get("timestep"))
        self.possible_agents = self._find_possible(core, world)
        self._coming, self._num_arrived = set(self.possible_agents), 0
        self._wait(core)
        self._view.follow(core)
        return self._named(self._seen()), self._named(core.infos())

    def step(self, actions: Mapping[str, npt.ArrayLike]) -> tuple[Named, Named, Named, Named, Named]:
        """Drive for one timestep.

        Args:
            actions: (2,) steering and throttle for every agent in ``agents``.

        Returns:
            Observations, rewards, terminations, truncations and infos, of the agents that acted and of those that
            have appeared.

        Raises:
            ResetNeeded: No agent is left, or no episode has begun.
            BadParameter: An agent has no action, there is an action for somebody else, or one is not a number.
        """
        if not self.agents:
            raise ResetNeeded("step needs an agent; call reset first")
        if actions.keys() != set(self.agents):
            wrong = sorted(actions.keys() ^ set(self.agents))
            raise BadParameter(f"actions: wanted one for each of agents; of {wrong[0]!r} there is one too many or few")
        core = self.core
        core.step(np.array([actions[agent] for agent in self.agents], np.float64))
        self._name_agents(core)
        status = core.status.copy()
        ends = core.terminated.tolist(), core.truncated.tolist()
        values = self._seen(), core.rewards.tolist(), *ends, core.infos()
        observations, rewards, terminated, truncated, infos = map(self._named, values)
        self._num_arrived += int((status == ARRIVED).sum())
        if status.any():
            core.retire(np.flatnonzero(status))
            self._wait(core)
            late = set(self.agents) - observations.keys()  # they appeared while nobody acted
            observations |= {agent: seen for agent, seen in self._named(self._seen()).items() if agent in late}
            infos |= {agent: info for agent, info in self._named(core.infos()).items() if agent in late}
            rewards |= dict.fromkeys(late, 0.0)
            terminated |= dict.fromkeys(late, False)
            truncated |= dict.fromkeys(late, False)
        self._view.follow(core)
        return observations, rewards, terminated, truncated, infos

    def render(self) -> Any:
        """As ``ScenarioNetEnv.render``, from above the recording vehicle."""
        return self._view.render(self.core)

    def close(self) -> None:
        """End the thread, the physics and the window; reset starts them again."""
        self.agents = []
        self._episodes.close()
        self._view.close()

    @property
    def core(self) -> BatchedEnvironment:
        """The world inside, for who wants to look deeper.

        Raises:
            ResetNeeded: There was no reset yet.
        """
        return self._episodes.core

    def _find_possible(self, core: BatchedEnvironment, world: World) -> list[str]:
        """Agents that are there when the episode begins, or come later."""
        driver, simulation = core.simulation.driver[0, : world.num_objects], core.simulation
        numbers = [number for number, policy in enumerate(simulation.policies) if isinstance(policy, External)]
        start = int(simulation.state.timestep[0])
        comes = world.log_valid[start:].any(axis=0)
        return list(map(str, world.track_ids[np.isin(driver, numbers) & comes]))

    def _wait(self, core: BatchedEnvironment) -> None:
        """Let time pass until an agent is there, if one is to come; then the episode is over."""
        self._name_agents(core)
        while not self.agents and self._coming:
            core.step(np.zeros((0, 2)))
            self._name_agents(core)
        if not self.agents and self.possible_agents:
            self._episodes.report(0, self._num_arrived / len(self.possible_agents))

    def _name_agents(self, core: BatchedEnvironment) -> None:
        (world,) = core.simulation.batch.worlds
        self.agents = list(map(str, world.track_ids[core.agents[:, 1]]))
        self._coming.difference_update(self.agents)

    def _seen(self) -> list[Any]:
        return self._episodes.observation.split(self._episodes.observe())

    def _named(self, values: list[Any]) -> Named:
        return dict(zip(self.agents, values, strict=True))
