"""What looks at the agents of a simulation as a part of each step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.sensors.observation_kernels import Sensing
from scenarionet_sim.simulation.seats import Seats
from scenarionet_sim.task.scoring_kernels import NUM_TOTALS, StepResult


@dataclass(eq=False)
class Observer:
    """Scores and observes the agents as a part of each step.

    Attributes:
        task: (16,) see ``task.task_parameters``.
        totals: (W, N, 9) sums over the episodes, see ``task.scoring_kernels.NUM_TOTALS``.
        result: Scores of the agents, by place.
        sensing: Sensors of the agents.
        phases: Any of ``SCORE``, ``OBSERVE`` and ``SETTLE``.
        seats: Flat buffers.
        num_seats: Number of places of each world whose agents are observed; None for all.
        is_stale: Whether the agents have changed since they were observed.
    """

    task: Float64
    totals: Float64
    result: StepResult
    sensing: Sensing
    phases: int
    seats: Seats
    num_seats: int | None = None
    is_stale: bool = False

    @classmethod
    def nothing(cls, num_worlds: int) -> Observer:
        """Return an observer of W worlds that does nothing."""
        totals = np.zeros((0, 0, NUM_TOTALS))
        return cls(np.zeros(12), totals, StepResult.of(0), Sensing.of(()), 0, Seats.of(num_worlds, 0, 0))

    def resize(self, num_places: int, num_worlds: int, num_objects: int) -> None:
        """Make room for the results of agents at other places, or of worlds of up to another number of objects."""

    def renew_results(self) -> None:
        """Let the next step write its results to arrays that nothing else refers to."""

    def copy_results(self) -> None:
        """Let results of some agents that come before the next step be written to copies of the last step's."""
