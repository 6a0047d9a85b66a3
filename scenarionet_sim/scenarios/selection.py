"""Picklable specification of the scenarios that an environment plays, and of their order.

DuckDB selects once, when an environment is made, if there is a condition or an order; ``sampling`` draws and ``stream``
loads. This module must not import polars: its threads do not survive the fork with which vector environments start
their processes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pyarrow as pa

from scenarionet_data import Database, Lake, ScenarioDescription, ScenarioLoader, VariationSpace
from scenarionet_data.arrays.dtypes import IntP, is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import check_expression
from scenarionet_data.variations.drawing import variation_of
from scenarionet_sim.scenarios.sampling import Curriculum, CurriculumSampler, Sampler, Sequential, Shuffled, Weighted

Order = Literal["sequential", "random", "weighted"]


@dataclass(frozen=True)
class Scenarios:
    """Scenarios of a lake to play.

    Attributes:
        lake: The lake, its path or its URL; stored as text.
        database: A ``Database``, a name (``"busy"``, ``"busy@2"``), scenario ids, or None for the whole lake.
            A saved ``Database`` is stored as its reference, an unsaved one as its ids.
        where: SQL condition over ``metadata`` that restricts them further.
        order: ``sequential`` in the order of the database, ``random`` for a new permutation in every round, or
            ``weighted`` for independent draws.
        weight: SQL expression over ``metadata`` for ``weighted``; empty for the weights of the database.
        curriculum: Play from easy to hard instead of by ``order``.
        variations: Play variations of the scenarios instead, ``variations.number`` of each, which are drawn and made
            when they are loaded; in order of the scenarios, the first of each, then the second ones.
        worker, num_workers: Play only this worker's share; with a curriculum, its share of every level.
        snapshot: Snapshot of the lake; by default that of ``lake`` or of an unsaved ``Database``, else the newest.

    Example:
        Scenarios("lake", "busy_train", where="ego_distance > 10", order="random")
        Scenarios("lake", curriculum=Curriculum(levels=10), worker=2, num_workers=4)
    """

    lake: Lake | str | Path
    database: Database | str | Sequence[str] | None = None
    where: str = ""
    order: Order = "sequential"
    weight: str = ""
    curriculum: Curriculum | None = None
    variations: VariationSpace | None = None
    worker: int = 0
    num_workers: int = 1
    snapshot: int | None = None

    def __post_init__(self) -> None:
        if isinstance(self.lake, Lake):
            object.__setattr__(self, "snapshot", self.snapshot or self.lake.snapshot.number or None)
            object.__setattr__(self, "lake", str(self.lake.root))
        elif isinstance(self.database, Database) and not self.database.is_saved:
            object.__setattr__(self, "snapshot", self.snapshot or self.database.lineage.snapshot)
        if not isinstance(self.lake, str | Path):
            raise BadParameter(f"lake={self.lake!r}; expected a lake, its path or its URL")
        object.__setattr__(self, "lake", str(self.lake))
        object.__setattr__(self, "database", database_reference(self.database))
        if self.order not in get_args(Order):
            raise BadParameter(f"order={self.order!r}; expected {', '.join(get_args(Order))}")
        if self.curriculum is not None and self.order != "sequential":
            raise BadParameter(f"order={self.order!r} conflicts with curriculum; drop one of them")
        if self.weight and self.order != "weighted":
            raise BadParameter(f"weight={self.weight!r} has no effect with order={self.order!r}; pass order='weighted'")
        for name in ("where", "weight"):
            if not isinstance(getattr(self, name), str):
                raise BadParameter(f"{name}={getattr(self, name)!r}; expected SQL as text")
        if not isinstance(self.curriculum, Curriculum | None):
            raise BadParameter(f"curriculum={self.curriculum!r}; expected, for example, Curriculum(levels=8)")
        if not isinstance(self.variations, VariationSpace | None):
            raise BadParameter(f"variations={self.variations!r}; expected VariationSpace({{'ego.speed': (0.8, 1.2)}})")
        for name, least in (("worker", None), ("num_workers", 1), ("snapshot", None)):
            value = getattr(self, name)
            if not is_count(value, least) and (name, value) != ("snapshot", None):
                raise BadParameter(f"{name}={value!r}; expected a whole number")
        if not 0 <= self.worker < self.num_workers:
            raise BadParameter(f"worker={self.worker} of num_workers={self.num_workers}; workers are numbered from 0")

    def open(self) -> tuple[ScenarioLoader | VariedScenarios, Sampler]:
        """Resolve the selection.

        Returns:
            A loader of this worker's share, and a sampler of its indices.

        Raises:
            NoSuchSnapshot: The lake does not exist.
            DatabaseNotFound, ScenarioNotFound: The database or an id does not exist.
            UnsafeSql, QueryError: A condition is not a single valid SQL expression.
            BadParameter: No scenario is left.
        """
        lake = Lake(str(self.lake), self.snapshot)
        if self.where or self.order == "weighted" or self.curriculum is not None:
            lake, rows = lake.resolve(self.database)
            ids = rows["scenario_id"]
            selected = self._select(lake, ids)
        else:  # without DuckDB, which takes 30 MB
            lake, members = lake.find(self.database)
            ids = members.ids
            selected = pa.table({"scenario_id": ids})
        count, of_each = len(selected), 1 if self.variations is None else self.variations.number
        played = np.arange(self.worker, count * of_each, self.num_workers)
        rows = played // of_each if self.curriculum is not None else played % max(count, 1)
        share = selected.take(rows)
        if not len(share):
            source = f"database {self.database}" if isinstance(self.database, str) else str(self.lake)
            total = count * of_each
            why = f"{total} scenarios are too few for worker {self.worker}; use at most {total} workers"
            if not count:
                why = f"none of {len(ids)} in {source} satisfies {self.where!r}" if len(ids) else f"{source} is empty"
            raise BadParameter(f"no scenario to play: {why}")
        sampler: Sampler
        if self.curriculum is not None:
            sampler = CurriculumSampler(len(share), self.curriculum)
        elif self.order == "weighted":
            sampler = Weighted(share["weight"].fill_null(np.nan).to_numpy())
        else:
            sampler = Shuffled(len(share)) if self.order == "random" else Sequential(len(share))
        if self.variations is None:
            return ScenarioLoader(lake, share["scenario_id"].to_pylist()), sampler
        numbers = played % of_each if self.curriculum is not None else played // max(count, 1)
        return VariedScenarios(
            ScenarioLoader(lake, selected["scenario_id"].to_pylist()), rows, numbers, self.variations
        ), sampler

    def _select(self, lake: Lake, ids: pa.ChunkedArray) -> pa.Table:
        """Columns scenario_id and weight of the ids that satisfy ``where``, in playing order."""
        expressions = {
            "is_selected": self.where or "true",
            "weight": self.weight or "1.0",
            "difficulty": self.curriculum.by if self.curriculum else "0.0",
        }
        for expression in expressions.values():
            check_expression(expression)
        columns = ", ".join(f"({text}\n) AS {name}" for name, text in expressions.items())
        weights = pa.nulls(len(ids), pa.float64())  # weights of a database, unless an expression replaces them
        if not self.weight and isinstance(self.database, str):
            weights = lake.database(self.database).members["weight"].combine_chunks()
        listed = pa.table({"scenario_id": ids, "rank": np.arange(len(ids)), "weight": weights})
        return lake.arrow(
            f"""SELECT scenario_id, coalesce(listed.weight, CAST(selected.weight AS DOUBLE)) AS weight
            FROM listed JOIN (SELECT scenario_id, {columns} FROM metadata) AS selected USING (scenario_id)
            WHERE selected.is_selected ORDER BY selected.difficulty NULLS FIRST, listed.rank""",
            tables={"listed": listed},
        )


class VariedScenarios:
    """Variations of scenarios, which are made when they are asked for.

    Args:
        parents: The scenarios.
        rows: (V,) scenario of each variation.
        numbers: (V,) number among the variations of its scenario.
        space: What is varied.

    Attributes:
        scenario_ids: ``PARENT@NUMBER`` of each variation.
    """

    def __init__(self, parents: ScenarioLoader, rows: IntP, numbers: IntP, space: VariationSpace) -> None:
        self._parents, self._rows, self._numbers, self._space = parents, rows, numbers, space
        ids = parents.scenario_ids
        self.scenario_ids = [f"{ids[row]}@{number:06d}" for row, number in zip(rows, numbers, strict=True)]

    def __getitem__(self, index: int) -> ScenarioDescription:
        """Make a variation.

        Raises:
            InvalidScenario: It and all that were drawn in its place cannot be.
        """
        return variation_of(self._parents[int(self._rows[index])], self._space, int(self._numbers[index]))


def resolved(
    lake: Lake | str | Path, database: Database | str | Sequence[str] | None
) -> tuple[Lake, str | tuple[str, ...] | None]:
    """Return the lake and, of an existing database, its reference.

    Raises:
        DatabaseNotFound: The database does not exist.
    """
    lake, reference = lake if isinstance(lake, Lake) else Lake(lake), database_reference(database)
    return lake, lake.database(reference).reference if isinstance(reference, str) else reference


def database_reference(database: Database | str | Sequence[str] | None) -> str | tuple[str, ...] | None:
    """Return a picklable and comparable form: ``name@version`` of a saved database, or the ids."""
    if database is None or isinstance(database, str):
        return database
    if isinstance(database, Database):
        return database.reference if database.name else tuple(database.scenario_ids)
    if not isinstance(database, Sequence) or not all(isinstance(each, str) for each in database):
        raise BadParameter(f"database={database!r}; expected a database, its name, or scenario ids")
    return tuple(database)
