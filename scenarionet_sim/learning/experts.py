"""Transitions of experts: what recorded vehicles observed along the log, by ``scenarionet runs record``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from scenarionet_data import Lake
from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.errors import BadParameter

_MOST = 200_000
"""Largest number of transitions to keep in memory; of more, an even share of every scenario is taken."""


class Experts:
    """Pairs of consecutive observations of the same recorded vehicle.

    Args:
        pairs: (N, 2, D) float32.

    Attributes:
        pairs: The same.
        mean, deviation: (D,) of the observations; the deviation is at least 0.05, so that columns that are constant for
            experts are not magnified.
    """

    def __init__(self, pairs: Tensor) -> None:
        self.pairs = pairs
        observations = pairs.flatten(0, 1)
        self.mean, self.deviation = observations.mean(dim=0), observations.std(dim=0).clamp(min=0.05)

    @classmethod
    def recorded(cls, lake: Lake | str | Path, run: str) -> Experts:
        """Return the transitions of a run of ``scenarionet runs record``.

        Raises:
            BadParameter: There is no such run, or it has no transitions.
        """
        query = """
            WITH numbered AS (
                SELECT observation, timestep, scenario_id, track_id,
                    lead(observation) OVER track AS after, lead(timestep) OVER track AS next_timestep
                FROM observations WHERE run = $run
                WINDOW track AS (PARTITION BY scenario_id, track_id ORDER BY timestep)
            ), pairs AS (SELECT *, row_number() OVER (ORDER BY hash(scenario_id, track_id, timestep)) AS rank
                FROM numbered WHERE next_timestep = timestep + 1)
            SELECT observation, after FROM pairs WHERE rank <= $most ORDER BY rank
        """
        lake = lake if isinstance(lake, Lake) else Lake(lake)
        rows = lake.arrow(query, {"run": run, "most": _MOST})
        if not len(rows):
            raise BadParameter(
                f"no transitions of experts in run {run!r}; record them with scenarionet_sim.record and pass its name",
                cli_remedy="scenarionet runs record LAKE DATABASE --name NAME, then --observations NAME",
            )
        columns = [rows[name].combine_chunks() for name in ("observation", "after")]
        arrays: list[Float32] = [column.flatten().to_numpy().reshape(len(column), -1) for column in columns]
        return cls(torch.from_numpy(np.stack(arrays, axis=1)))

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        """Return random transitions (count, 2, D)."""
        return self.pairs[torch.randint(len(self.pairs), (count,), generator=generator)]
