"""The table of scenarios, a page at a time: which rows, in which order, found by DuckDB whatever the table's length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, QueryError
from scenarionet_data.query import suggestions
from scenarionet_data.query.members import ADDRESS_COLUMNS
from scenarionet_data.query.statements import check_expression

MOST_ROWS = 200
"""Of a page."""

_NESTED = ("List", "Struct", "Array")
_NUMBERS = ("Int", "UInt", "Float")
_FLOATS = "Float"


@dataclass(frozen=True)
class Column:
    """A column of ``metadata``.

    Attributes:
        name: As SQL has it.
        unit, doc: The contract's; empty for a column of the user's own.
        is_number: Whether it is drawn to the right.
        is_sortable: Lists have no order that means something.
        may_be_nan: Holds floating-point numbers.
    """

    name: str
    unit: str
    doc: str
    is_number: bool
    is_sortable: bool
    may_be_nan: bool = False

    @property
    def order(self) -> str:
        """SQL for what rows are ordered by: to DuckDB, NaN is the largest number."""
        return f"""nullif("{self.name}", 'nan')""" if self.may_be_nan else f'"{self.name}"'


@dataclass(frozen=True)
class Question:
    """What a page shows.

    Attributes:
        where: SQL condition over ``metadata``.
        sort: Column it is ordered by; ids break ties.
        is_falling: Largest first; what is null comes last either way.
        first: Rows to skip.
        count: Rows wanted.
        columns: Columns wanted beside the id.
    """

    where: str
    sort: str
    is_falling: bool
    first: int
    count: int
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Page:
    """The answer.

    Attributes:
        total: Rows that satisfy the condition.
        first: Place of the first row here.
        rows: By column; what JSON has no word for is text or None.
    """

    total: int
    first: int
    rows: list[dict[str, Any]]


def columns(lake: Lake) -> list[Column]:
    """Every column that a condition may name but for addresses, the user's own ones included."""
    from scenarionet_data.schema import tables

    metadata = tables.load("metadata")
    declared = {column.name: column for column in (*metadata.columns, *metadata.derived)}
    found = []
    for name, kind in lake.sql("SELECT * FROM metadata LIMIT 0").schema.items():
        if name not in ADDRESS_COLUMNS:
            column, word = declared.get(name), str(kind)
            unit, doc = (column.unit or "", column.doc) if column else ("", "")
            is_number, is_sortable = word.startswith(_NUMBERS), not word.startswith(_NESTED)
            found.append(Column(name, unit, doc, is_number, is_sortable, word.startswith(_FLOATS)))
    return found


def page(lake: Lake, question: Question, known: dict[str, Column]) -> Page:
    """The rows of a page.

    Args:
        lake: The lake, or the part of it that is looked at.
        question: Which rows.
        known: The columns by name.

    Raises:
        UnsafeSql: The condition is no single expression.
        QueryError: DuckDB does not understand it; the message says where.
        BadParameter: A column that is not there, or one without an order.
    """
    for name in (question.sort, *question.columns):
        if name not in known:
            raise BadParameter(f"no column {name!r}; the page's list of columns has them all")
    if not known[question.sort].is_sortable:
        raise BadParameter(f"{question.sort} holds lists, which have no order; sort by another column")
    check_expression(question.where)
    try:
        total = int(lake.arrow(f"SELECT count(*) FROM metadata WHERE ({question.where}\n)")[0][0].as_py())
        return Page(total, question.first, _rows(lake, question, known[question.sort], total))
    except QueryError as error:
        raise suggestions.explain_unknown_column(error, question.where) from error


def _rows(lake: Lake, question: Question, sort: Column, total: int) -> list[dict[str, Any]]:
    """Rows counted from the nearer end: DuckDB then keeps fewer of them in order while it looks."""
    count = min(question.count, total - question.first)
    if count <= 0:
        return []
    is_mirrored = question.first > total // 2
    skipped = total - question.first - count if is_mirrored else question.first
    falling = question.is_falling != is_mirrored
    order = f"{sort.order} {'DESC' if falling else 'ASC'} NULLS {'FIRST' if is_mirrored else 'LAST'}"
    ties = f"scenario_id {'DESC' if is_mirrored else 'ASC'}"
    wanted = ", ".join(f'"{name}"' for name in dict.fromkeys(("scenario_id", *question.columns)))
    found = lake.arrow(
        f"SELECT {wanted} FROM metadata WHERE ({question.where}\n) "
        f"ORDER BY {order}, {ties} LIMIT $count OFFSET $skipped",
        {"count": count, "skipped": skipped},
    ).to_pylist()
    return [{name: plain(value) for name, value in row.items()} for row in (found[::-1] if is_mirrored else found)]


def plain(value: Any) -> Any:
    """A value as JSON and JavaScript know it; whole numbers beyond 2^53 are text there."""
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, int) and abs(value) > 2**53:
        return str(value)
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
