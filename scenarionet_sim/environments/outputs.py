"""What steps of an environment return: in arrays of steps before that nothing refers to any more, or in new ones."""

from __future__ import annotations

import sys

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.task.scoring_kernels import HAS_ARRIVED, NUMBERS, StepResult
from scenarionet_sim.task.task import ARRIVED, OFF_ROUTE, TIMED_OUT

ENDS = {"success": ARRIVED, "out_of_road": OFF_ROUTE, "timeout": TIMED_OUT}
"""How an episode ended, in the terms of the paper's metrics."""

RESULTS = (*NUMBERS, *ENDS, "timestep")
"""Names of the results of a step."""

_KEPT = 4
"""Largest number of outputs that are used again."""


class StepOutput:
    """What a step returns of the agents at C places.

    Args:
        observation: Sensors of the agents.
        num_places: C.

    Attributes:
        observed: Observations, see ``Observation.allocate``.
        sensing: The compiled sensors, which write them.
        result: Scores.
        named: Numbers, ends and timesteps of the scores by ``RESULTS``.
    """

    def __init__(self, observation: Observation, num_places: int) -> None:
        self.observed, self.sensing = observation.allocate(num_places)
        self.result = StepResult.of(num_places)
        seen: list[Array] = list(self.observed.values()) if isinstance(self.observed, dict) else [self.observed]
        result = self.result
        self.named = dict(zip(RESULTS, (*result.numbers, *result.flags[HAS_ARRIVED:], result.timestep), strict=True))
        self._arrays = [self.sensing.out, *seen, *result, *self.named.values()]
        del seen, result
        self._references = list(map(sys.getrefcount, self._arrays))

    @property
    def is_unused(self) -> bool:
        """Whether nothing else refers to any of the arrays, or to a view of one."""
        return list(map(sys.getrefcount, self._arrays)) == self._references


class StepOutputs:
    """The outputs of one step after another.

    Args:
        observation: Sensors of the agents.
        num_places: Number of places.
    """

    def __init__(self, observation: Observation, num_places: int) -> None:
        self._observation, self._num_places = observation, num_places
        self._kept: list[StepOutput] = []

    def next(self) -> StepOutput:
        """Return an output, of undefined values, to which nothing refers."""
        for number, output in enumerate(self._kept):
            if output.is_unused:
                self._kept.append(self._kept.pop(number))  # look at those first that were used longest ago
                return output
        output = StepOutput(self._observation, self._num_places)
        if len(self._kept) < _KEPT:
            self._kept.append(output)
        return output
