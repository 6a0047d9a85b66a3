"""Pages of the scenario table, filtered and sorted by DuckDB."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import check_expression, explaining
from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS

MAX_ROWS = 200
"""Maximum number of rows of a page."""

_NESTED = ("List", "Struct", "Array")
_NUMBERS = ("Int", "UInt", "Float")
_FLOATS = "Float"


@dataclass(frozen=True)
class PageColumn:
    """A column of ``metadata``.

    Attributes:
        name: Name in SQL.
        unit, doc: Unit and description from the schema; empty for user columns.
        is_number: Whether values are numbers, which are right-aligned.
        is_sortable: False for nested values.
        may_be_nan: Whether values are floating-point numbers.
        of_run: Whether it is a result of the run that is shown.
        sorted_by: SQL expression to sort by, if not the column.
    """

    name: str
    unit: str
    doc: str
    is_number: bool
    is_sortable: bool
    may_be_nan: bool = False
    of_run: bool = False
    sorted_by: str = ""

    @property
    def order(self) -> str:
        """SQL expression to sort by; NaN, which DuckDB sorts as the largest number, becomes null."""
        if self.sorted_by:
            return self.sorted_by
        return f"""nullif("{self.name}", 'nan')""" if self.may_be_nan else f'"{self.name}"'


@dataclass(frozen=True)
class PageQuery:
    """Which rows a page shows.

    Attributes:
        where: SQL condition over ``metadata``.
        sort: Column to sort by; ties are broken by scenario id.
        is_falling: Sort in descending order; nulls come last in either case.
        first: Number of rows to skip.
        count: Number of rows of the page.
        columns: Columns besides the scenario id.
        source: SQL for the rows, see :func:`.choices.source`.
    """

    where: str
    sort: str
    is_falling: bool
    first: int
    count: int
    columns: tuple[str, ...]
    source: str = "metadata"


@dataclass(frozen=True)
class Page:
    """Rows of one page.

    Attributes:
        total: Number of rows that satisfy the condition.
        first: Position of the first row of the page.
        rows: Values by column, in JSON types; see :func:`plain`.
    """

    total: int
    first: int
    rows: list[dict[str, Any]]


def columns(lake: Lake) -> list[PageColumn]:
    """Return the columns that conditions can use, including user columns but not row addresses."""
    from scenarionet_data.schema import tables

    metadata = tables.load("metadata")
    declared = {column.name: column for column in (*metadata.columns, *metadata.derived)}
    found = []
    for name, kind in lake.sql("SELECT * FROM metadata LIMIT 0").schema.items():
        if name not in ADDRESS_COLUMNS:
            column, word = declared.get(name), str(kind)
            unit, doc = (column.unit or "", column.doc) if column else ("", "")
            is_number, is_sortable = word.startswith(_NUMBERS), not word.startswith(_NESTED)
            found.append(PageColumn(name, unit, doc, is_number, is_sortable, word.startswith(_FLOATS)))
    return found


def read_page(lake: Lake, query: PageQuery, known: Mapping[str, PageColumn]) -> Page:
    """Read the rows of a page.

    Args:
        lake: The lake, possibly restricted to a database.
        query: Which rows.
        known: The lake's columns by name.

    Raises:
        UnsafeSql: The condition is not a single expression.
        QueryError: The condition is not valid SQL; the message says where.
        BadParameter: A column does not exist or cannot be sorted.
    """
    for name in (query.sort, *query.columns):
        if name not in known:
            raise BadParameter(f"no column {name!r}; choose one from the page's list of columns")
    if not known[query.sort].is_sortable:
        raise BadParameter(f"{query.sort} holds nested values, which cannot be sorted; sort by another column")
    check_expression(query.where)
    with explaining(query.where):
        total = int(lake.arrow(f"SELECT count(*) FROM {query.source} WHERE ({query.where}\n)")[0][0].as_py())
        return Page(total, query.first, _rows(lake, query, known[query.sort], total))


def _rows(lake: Lake, query: PageQuery, sort: PageColumn, total: int) -> list[dict[str, Any]]:
    """Read rows from the nearer end of the order, so that DuckDB keeps fewer rows for its top-N sort."""
    count = min(query.count, total - query.first)
    if count <= 0:
        return []
    is_mirrored = query.first > total // 2
    skipped = total - query.first - count if is_mirrored else query.first
    falling = query.is_falling != is_mirrored
    order = f"{sort.order} {'DESC' if falling else 'ASC'} NULLS {'FIRST' if is_mirrored else 'LAST'}"
    ties = f"scenario_id {'DESC' if is_mirrored else 'ASC'}"
    wanted = ", ".join(f'"{name}"' for name in dict.fromkeys(("scenario_id", *query.columns)))
    found = lake.arrow(
        f"SELECT {wanted} FROM {query.source} WHERE ({query.where}\n) "
        f"ORDER BY {order}, {ties} LIMIT $count OFFSET $skipped",
        {"count": count, "skipped": skipped},
    ).to_pylist()
    return [{name: plain(value) for name, value in row.items()} for row in (found[::-1] if is_mirrored else found)]


def plain(value: Any) -> Any:
    """Convert a value to JSON types; NaN, infinity and integers beyond 2^53 become text."""
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, int) and abs(value) > 2**53:
        return str(value)
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
