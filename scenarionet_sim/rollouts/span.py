"""What of a recording an evaluation drives: all of it, or the part that a benchmark scores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True)
class EpisodeSpan:
    """Start and length of an episode.

    Attributes:
        has_history: Begin after the history that the recording gives to predictors, at its ``current_timestep``,
            instead of at the ego's first state.
        duration: At most [s]; None for the ego's whole recording.
        waits: Drive on after the recording until the outcome is decided, as ScenarioNet does.
    """

    has_history: bool = False
    duration: float | None = None
    waits: bool = False

    def start(self, scenario: ScenarioDescription, world: World) -> int:
        """Timestep of the world at which it begins.

        Args:
            scenario: The recording.
            world: The same, at the timestep of the simulation.
        """
        if self.has_history:
            elapsed = scenario.timestamps[scenario.current_timestep] - scenario.timestamps[0]
            return round(float(elapsed) / world.dt)
        return int(np.argmax(world.log_valid[:, world.ego]))

    def num_steps(self, world: World, start: int) -> int:
        """Steps that are scored: from the start to the ego's last recorded state, or for the duration."""
        last = int(np.flatnonzero(world.log_valid[:, world.ego])[-1])
        recorded = max(last - start, 0)
        return recorded if self.duration is None else min(recorded, round(self.duration / world.dt))


EPISODES: Mapping[str, EpisodeSpan] = {
    "log": EpisodeSpan(waits=True),
    "nuplan": EpisodeSpan(duration=15.0),
    "wosac": EpisodeSpan(has_history=True, duration=8.0),
}
"""Episodes by name: the recording, nuPlan's closed loop, and the challenge on simulated agents (8 s after 1.1 s)."""
