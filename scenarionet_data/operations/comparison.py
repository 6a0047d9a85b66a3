"""Statistics of databases side by side, as in the ScenarioNet paper's table of databases."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.lake_view import LakeView


@dataclass(frozen=True)
class Measure:
    """One measure over the scenarios of a database.

    Attributes:
        measure: Name of the measure.
        unit: Its unit; ``ratio`` for a share of scenarios, empty for a count.
        scenarios: Number of scenarios with a value.
        mean, std, min, max: Statistics over those; std is None for ratios and for a single scenario.
    """

    measure: str
    unit: str
    scenarios: int
    mean: float | None
    std: float | None
    min: float | None
    max: float | None


@dataclass(frozen=True)
class DatabaseStatistics:
    """Statistics of the scenarios of a database.

    Attributes:
        name: ``name@version`` of the database, or ``lake`` for the whole lake.
        count: Number of scenarios.
        measures: Measures of ``sql/analytics/statistics.sql`` in its order; empty without scenarios.
    """

    name: str
    count: int
    measures: tuple[Measure, ...]


def compare(view: LakeView, *databases: DatabaseRecord | str) -> list[DatabaseStatistics]:
    """Compute statistics of databases; see :meth:`Lake.compare <scenarionet_data.Lake.compare>`."""
    wrong = [each for each in databases if not isinstance(each, DatabaseRecord | str)]
    if wrong:
        raise BadParameter(f'compare: give databases one by one, as compare("a", "b"), not {wrong[0]!r}')
    if not databases:
        return [_statistics("lake", view)]
    found = [view.record(each) for each in databases]
    return [_statistics(each.reference, view.restrict_to(each)) for each in found]


def _statistics(name: str, view: LakeView) -> DatabaseStatistics:
    measures = tuple(Measure(**row) for row in view.named_query("statistics").to_dicts())
    return DatabaseStatistics(name, len(view), measures)
