"""Samples of databases, drawn by seed: the same on all machines."""

from __future__ import annotations

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, QueryError
from scenarionet_data.operations.database_query import DatabaseQuery, check_column, uniform
from scenarionet_data.query import suggestions
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.query.statements import check_expression

_FROM_EASY = "row_number() OVER (ORDER BY difficulty, scenario_id)"
_LEVEL = f"(1 + ({_FROM_EASY} - 1) * $levels::BIGINT // count(*) OVER ())::VARCHAR"


def sample(
    lake: LakeLike,
    database: DatabaseRecord | str | None = None,
    *,
    name: str,
    n: int | None = None,
    fraction: float | None = None,
    seed: int = 0,
    weights: str = "1",
    stratify: str | None = None,
    balance: str | None = None,
    levels: int | None = None,
    replace: bool = False,
    allow_empty: bool = False,
) -> DatabaseRecord:
    """Save scenarios drawn without replacement; see :meth:`Lake.sample <scenarionet_data.Lake.sample>`."""
    if (n is None) == (fraction is None):
        raise BadParameter("wanted either a number of scenarios or a fraction")
    if n is not None and n < 1:
        raise BadParameter(f"wanted a number of 1 or more, found {n}")
    if fraction is not None and not 0 < fraction <= 1:
        raise BadParameter(f"wanted a fraction above 0 and up to 1, found {fraction:g}")
    check_expression(weights)
    view = open_view(lake)
    query = DatabaseQuery.over(view, database)
    sql = query.query("operations/sample", {"rounds": _rounds(query, weights, stratify, balance, levels)})
    parameters = {"seed": seed, "n": n, "fraction": fraction} | ({"levels": levels} if levels else {})
    try:
        return query.make("sample", name, sql, parameters, replace=replace, allow_empty=allow_empty, min_count=n or 0)
    except QueryError as error:
        raise suggestions.explain_unknown_column(error, weights, view.user_columns) from error


def _rounds(query: DatabaseQuery, weights: str, stratify: str | None, balance: str | None, levels: int | None) -> str:
    """Return SQL that gives each scenario its ``round`` and, within a round, its ``priority``."""
    if [stratify, balance, levels].count(None) < 2:
        raise BadParameter("wanted one of stratify (as the whole), balance (as many of each), levels (of difficulty)")
    if levels is not None and levels < 1:
        raise BadParameter(f"wanted 1 level or more, found {levels}")
    column = stratify or balance
    if column is not None:
        check_column(query.view, column, "to sample by")
    fields = {
        "stratum": f'"{column}"::VARCHAR' if column else _LEVEL if levels else "NULL::VARCHAR",
        "place": _FROM_EASY if levels else "place",
        "likelihood": weights,
        "drawn_id": uniform("scenario_id"),
    }
    priorities = query.query("samples/priorities", fields)
    method = "stratified" if stratify else "balanced" if balance or levels else "random"
    drawn_stratum = uniform("'stratum:' || coalesce(stratum, '')")
    return query.query(f"samples/{method}", {"priorities": priorities, "drawn_stratum": drawn_stratum})
