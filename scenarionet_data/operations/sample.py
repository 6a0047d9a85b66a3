"""Samples: some scenarios of a database, drawn by seed: the same on every machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter, QueryError
from scenarionet_data.operations import database_query as pools
from scenarionet_data.operations.database_query import Pool, Saving
from scenarionet_data.query import suggestions
from scenarionet_data.query.statements import check_expression

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake

_FROM_EASY = "row_number() OVER (ORDER BY difficulty, scenario_id)"
_LEVEL = f"(1 + ({_FROM_EASY} - 1) * $levels::BIGINT // count(*) OVER ())::VARCHAR"


def sample(
    lake: Lake,
    parent: Database | str | None,
    *,
    name: str,
    n: int | None = None,
    fraction: float | None = None,
    seed: int = 0,
    weights: str = "1",
    stratify: str | None = None,
    balance: str | None = None,
    levels: int | None = None,
    **saving: Unpack[Saving],
) -> Database:
    """Save scenarios drawn without replacement, in the order of the parent.

    Args:
        lake: The lake.
        parent: The database to draw from; the whole lake for None.
        name: Name of the new database.
        n: How many, exactly.
        fraction: How many, as a share of the parent.
        seed: Another seed, another sample.
        weights: SQL expression over ``metadata``, for example ``difficulty`` or ``weight``: who has twice as much is
            twice as likely to be drawn first. Scenarios without a weight above 0 are never drawn.
        stratify: Column whose values keep their proportions.
        balance: Column of whose values as many scenarios each are drawn, while there are any.
        levels: Of so many levels of difficulty as many scenarios each are drawn, and saved from easy to difficult: a
            curriculum. Levels are of equal size, in the order of ``difficulty``.
        **saving: ``replace``, ``allow_empty``.

    Raises:
        BadParameter: There are too few to draw from, or the arguments exclude each other.
        DatabaseExists, EmptyResult: See :class:`Saving`.
    """
    _check_size(n, fraction)
    check_expression(weights)
    pool = pools.of(lake, parent)
    query = pool.query("operations/sample", turns=_turns(pool, weights, stratify, balance, levels))
    parameters = {"seed": seed, "n": n, "fraction": fraction} | ({"levels": levels} if levels else {})
    try:
        drawn = pool.batches(query, parameters)
        return pool.save(pool.lineage("sample", query, parameters), name, drawn, saving, at_least=n or 0)
    except QueryError as error:
        raise suggestions.in_condition(error, weights, lake.layers) from error


def _check_size(n: int | None, fraction: float | None) -> None:
    if (n is None) == (fraction is None):
        raise BadParameter("wanted either a number of scenarios or a fraction")
    if n is not None and n < 1:
        raise BadParameter(f"wanted a number of 1 or more, found {n}")
    if fraction is not None and not 0 < fraction <= 1:
        raise BadParameter(f"wanted a fraction above 0 and up to 1, found {fraction:g}")


def _turns(pool: Pool, weights: str, stratify: str | None, balance: str | None, levels: int | None) -> str:
    """SQL that gives each scenario its ``turn`` and, among equals, its ``luck``."""
    if [stratify, balance, levels].count(None) < 2:
        raise BadParameter("wanted one of stratify (as the whole), balance (as many of each), levels (of difficulty)")
    if levels is not None and levels < 1:
        raise BadParameter(f"wanted 1 level or more, found {levels}")
    column = stratify or balance
    if column is not None:
        pools.check_column(pool.lake, column, "to sample by")
    way = "stratified" if stratify else "balanced" if balance or levels else "random"
    lucky = pool.query(
        "samples/lucky",
        stratum=f'"{column}"::VARCHAR' if column else _LEVEL if levels else "NULL::VARCHAR",
        place=_FROM_EASY if levels else "place",
        likelihood=weights,
        drawn_id=pools.drawn("scenario_id"),
    )
    return pool.query(f"samples/{way}", lucky=lucky, drawn_stratum=pools.drawn("'stratum:' || coalesce(stratum, '')"))
