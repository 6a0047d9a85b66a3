"""What all environments share: a series of scenarios that a seed settles, played in the slots of one arena."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.environments.arena import Arena
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.scenarios.stream import Stream
from scenarionet_sim.worlds.world import World


def action_space() -> spaces.Box:
    """Steering (positive to the left) and throttle (negative: brake)."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


class Episodes:
    """Scenarios one after the other, in each of several slots.

    Args:
        config: What everything is made of.
        seed: Of the series, unless ``restart`` names one; None for a random one.
        num_slots: Worlds side by side; they draw from one series.
        ahead: Scenarios loaded ahead; what ``config`` says for None.

    Attributes:
        observation: What agents observe.
        rng: The sensors' noise.
        seed: Of the series; None before the first ``restart`` of a random one.
    """

    def __init__(self, config: EnvConfig, seed: int | None, num_slots: int = 1, ahead: int | None = None) -> None:
        self.config, self.seed = config, seed
        self.observation = Observation(config.sensors, config.observation)
        loader, self._sampler = config.scenarios.open()
        self.ids = loader.scenario_ids
        self._stream = Stream(
            self.ids, loader.__getitem__, World.from_scenario, self._sampler,
            ahead=config.ahead if ahead is None else ahead, keep=config.keep,
        )  # fmt: skip
        self._is_fresh = True
        self._arena: Arena | None = None
        self._playing = np.zeros(num_slots, np.int64)

    def restart(self, seed: int | None) -> bool:
        """Begin the series again: with a seed, and the very first time. Returns whether it did."""
        if seed is None and not self._is_fresh:
            return False
        self.rng, self.seed = seeding.np_random(self.seed if seed is None else int(seed))
        self._stream.restart(self.seed)
        self._is_fresh = False
        return True

    def draw(self, slot: int = 0, scenario_id: str | None = None) -> World:
        """The world to play in a slot: a certain one, or the next of the series.

        Raises:
            ScenarioNotFound: No such scenario among those chosen.
            LakeError: The scenario cannot be read; the next draw goes on with the one after it.
        """
        if scenario_id is None:
            self._playing[slot], world = self._stream.next()
            return world
        self._playing[slot] = number = self._stream.number(scenario_id)
        return self._stream.get(number)

    def prepare(self, worlds: list[World]) -> Arena:
        """The arena for these worlds, whose episodes have yet to begin; another than before if time runs otherwise."""
        if self._arena is not None and not self._arena.can_play(worlds[0]):
            self._close_arena()
        if self._arena is None:
            self._arena = Arena(self.config, self.observation, worlds)
        return self._arena

    def report(self, slot: int, success: float) -> None:
        """Tell the series how the episode in a slot went: 1 for success, 0 for none, or the share of its agents."""
        self._sampler.report(int(self._playing[slot]), success)

    def observe(self, rows: Array | None = None) -> Any:
        """What the agents (some of them, by their place in ``Arena.agents``) observe."""
        return self.arena.observe(self.rng, rows)

    def close(self) -> None:
        """End the thread and the physics; the next episode starts them again."""
        self._stream.close()
        self._close_arena()

    @property
    def arena(self) -> Arena:
        """The worlds that are played.

        Raises:
            ResetNeeded: There is none yet, or no more.
        """
        if self._arena is None:
            raise ResetNeeded("there is no world yet; call reset first")
        return self._arena

    def _close_arena(self) -> None:
        if self._arena is not None:
            self._arena.close()
            self._arena = None
