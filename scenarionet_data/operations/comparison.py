"""Databases side by side: what their scenarios are like, as the ScenarioNet paper's table of databases has it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarionet_data.databases.record import Database
    from scenarionet_data.lake.lake import Lake


@dataclass(frozen=True)
class Measure:
    """One measure over the scenarios of a database.

    Attributes:
        measure: What is measured.
        unit: Its unit, ``ratio`` for a share of scenarios, empty for a count.
        scenarios: Scenarios that have it.
        mean, std, min, max: Over them; std is None for ratios and for a single scenario.
    """

    measure: str
    unit: str
    scenarios: int
    mean: float | None
    std: float | None
    min: float | None
    max: float | None


@dataclass(frozen=True)
class Statistics:
    """What the scenarios of a database are like.

    Attributes:
        name: ``name@version`` of the database, or ``lake`` for the whole lake.
        count: Its scenarios.
        measures: Those of ``sql/analytics/statistics.sql``, in its order; empty when there are no scenarios.
    """

    name: str
    count: int
    measures: tuple[Measure, ...]


def compare(lake: Lake, databases: Sequence[Database | str] = ()) -> list[Statistics]:
    """Statistics of databases in the given order; of the whole lake when none is given.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    if not databases:
        return [_statistics("lake", lake)]
    found = [lake.database(each) if isinstance(each, str) else each for each in databases]
    return [_statistics(each.reference, lake.only(each)) for each in found]


def _statistics(name: str, lake: Lake) -> Statistics:
    measures = tuple(Measure(**row) for row in lake.ask("statistics").to_dicts())
    return Statistics(name, len(lake), measures)
