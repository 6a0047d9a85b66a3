"""Histograms of columns of the scenario table, counted by DuckDB."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import check_expression, explaining
from scenarionet_pipelines.web.rows import PageColumn

MAX_BINS = 30


@dataclass(frozen=True)
class Histogram:
    """Counts of a numeric column in bins whose width is 1, 2 or 5 times a power of ten.

    Attributes:
        column: The column.
        low, high: Limits of the first and of the last bin, multiples of the width; None without any value.
        counts: Scenarios by bin that satisfy the condition; a bin includes its lower limit.
        missing: Scenarios without a finite value.
    """

    column: str
    low: float | None
    high: float | None
    counts: list[int]
    missing: int


def read_histogram(
    lake: Lake, column: str, where: str, known: Mapping[str, PageColumn], source: str = "metadata"
) -> Histogram:
    """Count the values of a column; the limits are those of the whole lake or database, so that bins keep their place.

    Args:
        lake: The lake, possibly restricted to a database.
        column: A numeric column.
        where: SQL condition over ``metadata``.
        known: The lake's columns by name.
        source: SQL for the rows, see :func:`.choices.source`.

    Raises:
        UnsafeSql: The condition is not a single expression.
        QueryError: The condition is not valid SQL; the message says where.
        BadParameter: The column does not exist or is not numeric.
    """
    if column not in known or not known[column].is_number:
        raise BadParameter(f"no numeric column {column!r}; choose one from the page's list of columns")
    check_expression(where)
    value = f'CASE WHEN isfinite("{column}"::DOUBLE) THEN "{column}"::DOUBLE END'
    limits = lake.arrow(f"SELECT min({value}), max({value}) FROM {source}").to_pylist()[0]
    low, high = limits.values()
    if low is None:
        return Histogram(column, None, None, [], 0)
    width = _rounded_up((high - low) / (MAX_BINS - 1)) if high > low else 1.0
    first, last = math.floor(low / width), math.floor(high / width)
    query = (
        f"SELECT (floor({value} / $width) - $first)::INTEGER AS bin, count(*) AS n "
        f"FROM {source} WHERE ({where}\n) GROUP BY bin"
    )
    with explaining(where):
        rows = lake.arrow(query, {"first": first, "width": width}).to_pylist()
    found = {row["bin"]: int(row["n"]) for row in rows}
    counts = [found.get(number, 0) for number in range(last - first + 1)]
    return Histogram(column, first * width, (last + 1) * width, counts, found.get(None, 0))


def _rounded_up(width: float) -> float:
    """Return the next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(width))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= width)
