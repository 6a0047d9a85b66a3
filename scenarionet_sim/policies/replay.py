"""The log as it was recorded, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.scenario import Codes
from scenarionet_sim.kernels.motion import replay
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.worlds.stage import Stage
from scenarionet_sim.worlds.state import State


@dataclass(frozen=True)
class Replay(Policy):
    """Objects are where they were recorded, and there only while they are valid.

    After the log's last timestep they stand where they are.
    """

    def advance(self, stage: Stage, now: State, then: State, driver: Codes, me: int, dt: float) -> None:
        """Copies the log's next row."""
        del dt
        replay(stage.log, stage.num_steps, now.timestep, driver, me, *then.motion)
