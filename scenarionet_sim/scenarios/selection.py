"""Which scenarios of a lake an environment plays, and in which order: a specification that pickles.

Choosing is DuckDB's, done once when an environment is made; drawing is ``sampling``'s; loading is ``stream``'s. Nothing
here may touch polars: its threads do not survive the fork by which vector environments make their processes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pyarrow as pa

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import check_expression
from scenarionet_sim.scenarios.sampling import Curriculum, Rising, Sampler, Sequential, Shuffled, Weighted

Order = Literal["sequential", "random", "weighted"]


@dataclass(frozen=True)
class Scenarios:
    """Scenarios of a lake.

    Attributes:
        lake: The lake's folder.
        scenarios: Name of a database (``name`` or ``name@version``), scenario ids, or None for the whole lake.
        where: SQL condition over ``metadata`` that they must satisfy too; empty for no condition.
        order: ``sequential`` as the database has them, ``random`` each once a round, or ``weighted``.
        weight: SQL expression over ``metadata`` for ``weighted``; empty for the database's own weights.
        curriculum: From easy to hard instead of ``order``.
        worker, num_workers: Each of several workers plays a share of its own; with a curriculum, of every level.

    Example:
        Scenarios("lake", "busy_train", where="ego_distance > 10", order="random")
        Scenarios("lake", curriculum=Curriculum(levels=10), worker=2, num_workers=4)
    """

    lake: str | Path
    scenarios: str | Sequence[str] | None = None
    where: str = ""
    order: Order = "sequential"
    weight: str = ""
    curriculum: Curriculum | None = None
    worker: int = 0
    num_workers: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "lake", str(self.lake))
        if self.scenarios is not None and not isinstance(self.scenarios, str):
            object.__setattr__(self, "scenarios", tuple(self.scenarios))
        if self.order not in get_args(Order):
            raise BadParameter(f"order {self.order!r}; there are {', '.join(get_args(Order))}")
        if self.curriculum is not None and self.order != "sequential":
            raise BadParameter(f"a curriculum has an order of its own; leave out order={self.order!r}")
        if self.weight and self.order != "weighted":
            raise BadParameter(f"weight={self.weight!r} means nothing for order={self.order!r}; give order='weighted'")
        if not 0 <= self.worker < self.num_workers:
            raise BadParameter(f"worker {self.worker} of {self.num_workers}; workers count from 0")

    def open(self) -> tuple[ScenarioLoader, Sampler]:
        """Look them up.

        Returns:
            The loader of this worker's share, and the order to play it in.

        Raises:
            NoSuchSnapshot: There is no lake.
            DatabaseNotFound, ScenarioNotFound: Naming what is missing.
            UnsafeSql, QueryError: A condition is not one expression, or not understood.
            BadParameter: Nothing is left to play.
        """
        lake, rows = Lake(self.lake).resolve(self.scenarios)
        chosen = self._chosen(lake, rows["scenario_id"])
        share = chosen.take(np.arange(self.worker, len(chosen), self.num_workers))
        if not len(share):
            raise BadParameter(f"no scenario to play: {self._told(len(rows), len(chosen))}")
        return ScenarioLoader(lake, share["scenario_id"].to_pylist()), self._sampler(share)

    def _chosen(self, lake: Lake, ids: pa.ChunkedArray) -> pa.Table:
        """Columns scenario_id and weight of those that satisfy the condition, in their order."""
        expressions = {
            "wanted": self.where or "true",
            "weight": self.weight or "1.0",
            "difficulty": self.curriculum.by if self.curriculum else "0.0",
        }
        for expression in expressions.values():
            check_expression(expression)
        columns = ", ".join(f"({text}\n) AS {name}" for name, text in expressions.items())
        listed = pa.table({"scenario_id": ids, "place": np.arange(len(ids)), "weight": self._weights(lake, len(ids))})
        return lake.arrow(
            f"""SELECT scenario_id, coalesce(listed.weight, CAST(facts.weight AS DOUBLE)) AS weight
            FROM listed JOIN (SELECT scenario_id, {columns} FROM metadata) AS facts USING (scenario_id)
            WHERE facts.wanted ORDER BY facts.difficulty NULLS FIRST, listed.place""",
            tables={"listed": listed},
        )

    def _weights(self, lake: Lake, count: int) -> pa.Array:
        """The database's weights; missing where there is no database, or an expression instead."""
        if self.weight or not isinstance(self.scenarios, str):
            return pa.nulls(count, pa.float64())
        return lake.database(self.scenarios).members["weight"].combine_chunks()

    def _sampler(self, share: pa.Table) -> Sampler:
        if self.curriculum is not None:
            return Rising(len(share), self.curriculum)
        if self.order == "weighted":
            return Weighted(share["weight"].fill_null(np.nan).to_numpy())
        return Shuffled(len(share)) if self.order == "random" else Sequential(len(share))

    def _told(self, there: int, satisfying: int) -> str:
        place = f"database {self.scenarios}" if isinstance(self.scenarios, str) else str(self.lake)
        if not there:
            return f"{place} is empty"
        if not satisfying:
            return f"none of {there} in {place} satisfies {self.where!r}"
        return f"{satisfying} scenarios do not reach worker {self.worker}; have fewer workers than scenarios"
