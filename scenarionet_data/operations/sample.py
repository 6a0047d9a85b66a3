"""Samples of databases, drawn by seed: the same on all machines."""

from __future__ import annotations

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.database_query import (
    AnyDatabase,
    DatabaseQuery,
    Pool,
    as_recorded,
    check_column,
    check_whole,
    uniform,
)
from scenarionet_data.query.statements import check_expression, explaining

_FROM_EASY = "row_number() OVER (ORDER BY difficulty, scenario_id)"
_LEVEL = f"(1 + ({_FROM_EASY} - 1) * $levels::BIGINT // count(*) OVER ())::VARCHAR"


class Sampling(Pool[AnyDatabase]):
    """The verb ``sample`` of lakes and databases."""

    def sample(
        self,
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
    ) -> AnyDatabase:
        """Save scenarios drawn without replacement, in the order of the database.

        Args:
            database: Database to draw from; the whole lake by default.
            name: Name of the new database.
            n: Exact number of scenarios.
            fraction: Share of scenarios, instead of ``n``.
            seed: Another seed gives another sample.
            weights: SQL expression over ``metadata``, for example ``difficulty`` or ``weight``: probability of being
                drawn first, up to a factor. Scenarios without a weight above 0 are never drawn.
            stratify: Column whose values keep their proportions.
            balance: Column whose values are drawn in equal numbers, while scenarios last.
            levels: Number of levels of ``difficulty``, of equal size, that are drawn in equal numbers and saved from
                easy to difficult: a curriculum.
            replace: Add a version if the database exists.
            allow_empty: Save a database without members, too.

        Raises:
            BadParameter: There are fewer scenarios than ``n``, or arguments exclude each other.
            DatabaseExists, EmptyResult: See :meth:`filter`.
        """
        if (n is None) == (fraction is None):
            raise BadParameter("wanted either a number of scenarios or a fraction")
        for what, value, least in (("n", n, 1), ("levels", levels, 1), ("seed", seed, None)):
            check_whole(what, value, least)
        if fraction is not None and not (isinstance(fraction, int | float) and 0 < fraction <= 1):
            raise BadParameter(f"fraction: wanted a number above 0 and up to 1, found {fraction!r}")
        check_expression(weights)
        query = self._query(database)
        sql = query.query("operations/sample", {"rounds": _rounds(query, weights, stratify, balance, levels)})
        parameters = as_recorded({"seed": seed, "n": n, "fraction": fraction} | ({"levels": levels} if levels else {}))
        with explaining(weights, query.view.user_columns):
            members = query.batches(sql, parameters, by_rows=levels is None)
            lineage = query.lineage("sample", sql, parameters)
            made = query.save(lineage, name, members, replace=replace, allow_empty=allow_empty, min_count=n or 0)
        return self._handle(made)


def _rounds(query: DatabaseQuery, weights: str, stratify: str | None, balance: str | None, levels: int | None) -> str:
    """Return SQL that gives each scenario its ``round`` and, within a round, its ``priority``."""
    if [stratify, balance, levels].count(None) < 2:
        raise BadParameter("wanted one of stratify (as the whole), balance (as many of each), levels (of difficulty)")
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
