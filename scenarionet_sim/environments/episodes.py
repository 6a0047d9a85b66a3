"""What all environments share: a series of scenarios that a seed settles, played in the slots of one core."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.scenarios.stream import ScenarioStream
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
        prefetch: Scenarios loaded prefetch; what ``config`` says for None.

    Attributes:
        observation: What agents observe.
        rng: The sensors' noise.
        seed: Of the series; None before the first ``restart`` of a random one.
    """

    def __init__(self, config: EnvConfig, seed: int | None, num_slots: int = 1, prefetch: int | None = None) -> None:
        self.config, self.seed = config, seed
        self.observation = Observation(config.sensors, config.observation)
        loader, self._sampler = config.scenarios.open()
        self.ids = loader.scenario_ids
        self._stream = ScenarioStream(
            self.ids, loader.__getitem__, World.from_scenario, self._sampler,
            prefetch=config.prefetch if prefetch is None else prefetch, cache_size=config.cache_size,
        )  # fmt: skip
        self._is_fresh = True
        self._core: BatchedEnvironment | None = None
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
        self._playing[slot] = number = self._stream.index(scenario_id)
        return self._stream.get(number)

    def prepare(self, worlds: list[World]) -> BatchedEnvironment:
        """The core for these worlds, whose episodes have yet to begin; another than before if time runs otherwise."""
        if self._core is not None and not self._core.can_play(worlds[0]):
            self._close_core()
        if self._core is None:
            self._core = BatchedEnvironment(self.config, self.observation, worlds)
        return self._core

    def report(self, slot: int, success: float) -> None:
        """Tell the series how the episode in a slot went: 1 for success, 0 for none, or the share of its agents."""
        self._sampler.report(int(self._playing[slot]), success)

    def observe(self, rows: Array | None = None) -> Any:
        """What the agents (some of them, by their place in ``BatchedEnvironment.agents``) observe."""
        return self.core.observe(self.rng, rows)

    def close(self) -> None:
        """End the thread and the physics; the next episode starts them again."""
        self._stream.close()
        self._close_core()

    @property
    def core(self) -> BatchedEnvironment:
        """The worlds that are played.

        Raises:
            ResetNeeded: There is none yet, or no more.
        """
        if self._core is None:
            raise ResetNeeded("there is no world yet; call reset first")
        return self._core

    def _close_core(self) -> None:
        if self._core is not None:
            self._core.close()
            self._core = None
