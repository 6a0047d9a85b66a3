"""What the table is narrowed to beside databases: results of a run, kept moments; and the moments of a scenario."""

from __future__ import annotations

from typing import Any

from scenarionet_data import Lake
from scenarionet_data.query.statements import quoted
from scenarionet_data.schema import tables
from scenarionet_data.schema.tables import Column
from scenarionet_pipelines.web.rows import PageColumn, columns, plain

_NUMBERS = ("int", "float")
_KEYS = ("run", "scenario_id", "track_id", "rollout")
_WORST = {
    ("bool", "higher"): "bool_and", ("bool", "lower"): "bool_or", ("", "higher"): "min", ("", "lower"): "max",
    ("string", ""): "max", ("dictionary", ""): "first",
}  # fmt: skip

_FAILED_FIRST = "(coalesce(success, false), coalesce(nuplan_score, 0))"
"""Scenarios that could not be simulated have neither."""

_RUNS = """
    SELECT
        run, count(DISTINCT scenario_id) AS scenarios,
        count(DISTINCT scenario_id) FILTER (success IS NOT TRUE) AS failed
    FROM results GROUP BY run ORDER BY run LIKE 'reference-%' OR run LIKE 'regression-%', run
"""
_MOMENTS = "SELECT name, definition, count(*) AS moments FROM moments GROUP BY ALL ORDER BY ALL"
_OF_SCENARIO = """
    SELECT name, definition, track_id, other_id, first_timestep, last_timestep, value
    FROM moments WHERE scenario_id = $scenario_id
    UNION ALL
    SELECT
        version, moment ->> 'definition', moment ->> 'actor', nullif(moment ->> 'other', ''), current_timestep,
        current_timestep + (moment ->> 'last')::INTEGER - (moment ->> 'first')::INTEGER, (extras ->> '$.value')::DOUBLE
    FROM (
        SELECT *, extras::JSON -> '$.moment' AS moment FROM metadata_rows
        WHERE scenario_id = $scenario_id AND dataset = 'moment'
    )
    ORDER BY ALL
"""


def runs(lake: Lake) -> list[dict[str, Any]]:
    """Return the runs of the lake with their scenarios, and how many of these failed; references come last."""
    return [*lake.arrow(_RUNS).to_pylist()]


def moments(lake: Lake) -> list[dict[str, Any]]:
    """Return the names under which moments are kept, their definitions and how many there are."""
    return [*lake.arrow(_MOMENTS).to_pylist()]


def moments_of(lake: Lake, scenario_id: str) -> list[dict[str, Any]]:
    """Return the kept moments of a scenario, and the one that it was cut out for."""
    rows = lake.arrow(_OF_SCENARIO, {"scenario_id": scenario_id}).to_pylist()
    return [{name: plain(value) for name, value in row.items()} for row in rows]


def all_columns(lake: Lake) -> list[PageColumn]:
    """Return the columns of ``metadata``, and those of results that the table can show of a run."""
    found = columns(lake)
    taken = {column.name for column in found}
    for column in _results():
        if column.name not in taken:
            is_number, is_float = column.type.startswith(_NUMBERS), column.type.startswith("float")
            order = _FAILED_FIRST if column.name == "success" else ""
            found.append(
                PageColumn(
                    column.name, column.unit, column.doc, is_number, True, is_float, of_run=True, sorted_by=order
                )
            )
    return found


def source(run: str) -> str:
    """Return SQL for the scenarios of a run with their worst results over rollouts and vehicles; all without a run.

    A scenario that could not be simulated has only ``error``.
    """
    if not run:
        return "metadata"
    worst = ", ".join(f'{_worst(column)}("{column.name}") AS "{column.name}"' for column in _results())
    return (
        f"(SELECT metadata.*, worst.* EXCLUDE (scenario_id) FROM metadata JOIN (SELECT scenario_id, {worst} "
        f"FROM results WHERE run = {quoted(run)} GROUP BY scenario_id) AS worst USING (scenario_id))"
    )


def _results() -> list[Column]:
    found = tables.load("results")
    return [column for column in (*found.columns, *found.derived) if column.name not in _KEYS]


def _worst(column: Column) -> str:
    """The aggregate that takes the worst value; of measures that are neither better nor worse, the largest."""
    kind = column.type if column.type in ("bool", "string", "dictionary") else ""
    return _WORST.get((kind, column.better), "max")
