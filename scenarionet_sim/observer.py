"""What looks at the agents of a simulation as a part of each step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.kernels.observation import Sensing
from scenarionet_sim.kernels.scoring import NUM_TOTALS, NUMBERS, StepResult


@dataclass(eq=False)
class Observer:
    """Scores and observes the agents as a part of each step.

    Attributes:
        task: (12,) see ``task.task_parameters``.
        result: Scores of the agents.
        sensing: Sensors of the agents.
        phases: ``SCORE``, ``OBSERVE``, both or neither.
    """

    task: Float64
    result: StepResult
    sensing: Sensing
    phases: int
    is_stale: bool = False
    """Whether the agents have changed since they were observed."""

    @classmethod
    def nothing(cls) -> Observer:
        """Return an observer that does nothing."""
        numbers, totals = np.zeros((0, len(NUMBERS))), np.zeros((0, 0, NUM_TOTALS))
        result = StepResult(numbers, np.zeros(0, np.uint8), totals)
        return cls(np.zeros(12), result, Sensing.of_no_sensors(), 0)

    def resize(self, num_agents: int, num_worlds: int, num_objects: int) -> None:
        """Allocate the results for other agents, in worlds of up to a number of objects."""
