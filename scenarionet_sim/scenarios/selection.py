"""Which scenarios of a lake an environment plays, and in which order: a specification that pickles.

Choosing is DuckDB's, done once when an environment is made; drawing is ``sampling``'s; loading is ``stream``'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import polars as pl

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.catalog.engine import check_expression
from scenarionet_data.errors import BadParameter
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
        chosen = self._chosen(lake, rows["scenario_id"].to_pylist())
        share = chosen[self.worker :: self.num_workers]
        if share.is_empty():
            raise BadParameter(f"no scenario to play: {self._told(len(rows), len(chosen))}")
        return ScenarioLoader(lake, share["scenario_id"].to_list()), self._sampler(share)

    def _chosen(self, lake: Lake, ids: list[str]) -> pl.DataFrame:
        """Columns scenario_id, weight and difficulty of those that satisfy the condition, in their order."""
        expressions = {
            "wanted": self.where or "true",
            "weight": self.weight or "1.0",
            "difficulty": self.curriculum.by if self.curriculum else "0.0",
        }
        for expression in expressions.values():
            check_expression(expression)
        columns = ", ".join(f"({text}\n) AS {name}" for name, text in expressions.items())
        facts = lake.sql(f"SELECT scenario_id, {columns} FROM metadata")
        listed = pl.DataFrame({"scenario_id": ids}, schema={"scenario_id": pl.String})
        if not self.weight and isinstance(self.scenarios, str):
            facts = facts.drop("weight")
            listed = listed.with_columns(weight=lake.database(self.scenarios).members["weight"].to_numpy())
        chosen = listed.join(facts, on="scenario_id", maintain_order="left").filter(pl.col("wanted"))
        return chosen.sort("difficulty", maintain_order=True) if self.curriculum else chosen

    def _sampler(self, share: pl.DataFrame) -> Sampler:
        if self.curriculum is not None:
            return Rising(len(share), self.curriculum)
        if self.order == "weighted":
            return Weighted(share["weight"].cast(pl.Float64).fill_null(np.nan).to_numpy())
        return Shuffled(len(share)) if self.order == "random" else Sequential(len(share))

    def _told(self, there: int, satisfying: int) -> str:
        place = f"database {self.scenarios}" if isinstance(self.scenarios, str) else str(self.lake)
        if not there:
            return f"{place} is empty"
        if not satisfying:
            return f"none of {there} in {place} satisfies {self.where!r}"
        return f"{satisfying} scenarios do not reach worker {self.worker}; have fewer workers than scenarios"
