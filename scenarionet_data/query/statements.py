"""User SQL: reject everything but reads, find the names it uses, locate errors, and suggest similar columns."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import QueryError, UnsafeSql
from scenarionet_data.schema import tables

_UNKNOWN_COLUMN = re.compile(r'Referenced (?:column|table) "(\w+)" not found')

if TYPE_CHECKING:  # imported where it is used: loaders need the rest of this file only
    import duckdb


def only_select(connection: duckdb.DuckDBPyConnection, sql: str, given: Mapping[str, Any]) -> str:
    """Return the query in a form that can only read; raise for everything but a single SELECT.

    It becomes a subquery, because at the top level ``WITH x AS (COPY ... TO ...) SELECT`` is a SELECT that writes.

    Args:
        connection: A locked connection, because parsing may read files.
        sql: The user's query.
        given: Values for ``$name`` in the query.

    Raises:
        UnsafeSql: It is not exactly one SELECT.
        QueryError: A parameter has no value, or values have no names.
    """
    _check_text(sql)
    if not isinstance(given, Mapping):
        raise QueryError(f"parameters: wanted values by name, such as {{'least': 3}}, found {given!r}")
    statements = connection.extract_statements(sql)
    if len(statements) != 1:
        raise UnsafeSql(f"wanted one SELECT, found {len(statements)} statements")
    kind = statements[0].type
    if kind.name != "SELECT":
        raise UnsafeSql(f"wanted one SELECT, found {kind.name}: a query only reads the lake")
    missing = sorted(statements[0].named_parameters - given.keys())
    if missing:
        raise QueryError(f"no value for ${', $'.join(missing)}: give each parameter of the query one")
    text = statements[0].query.rstrip().rstrip(";")
    return f"SELECT * FROM (\n{text}\n)"


def can_decode(path: str) -> bool:
    """Whether DuckDB decodes all values of a Parquet file."""
    import duckdb

    try:
        duckdb.connect().execute("SELECT count(COLUMNS(*)) FROM read_parquet(?)", [path])
    except duckdb.Error:
        return False
    return True


def check_expression(where: str) -> None:
    """Raise for everything but a single SQL expression.

    Raises:
        UnsafeSql: It is not one expression; the message is from DuckDB.
    """
    import duckdb

    _check_text(where)
    try:
        duckdb.SQLExpression(where)
    except duckdb.Error as error:
        position = error_position(where, "SELECT ")
        raise UnsafeSql(
            f"wanted one condition such as ego_distance > 10, found {where!r}: {error}{position}"
        ) from error


def _check_text(sql: str) -> None:
    if not isinstance(sql, str):
        raise QueryError(f"wanted SQL as text, found {sql!r}")
    try:
        sql.encode()
    except UnicodeEncodeError as error:
        raise QueryError(
            f"wanted SQL as UTF-8 text, found {sql[error.start : error.end]!r}; write it as an escape"
        ) from error


def error_position(sql: str, before: str = "") -> str:
    """Return `` (character N)`` of a syntax error, counted from 1, or an empty text if DuckDB does not report it.

    Args:
        sql: The user's SQL.
        before: SQL that completes it to a statement.
    """
    import duckdb

    connection = duckdb.connect(config={"enable_external_access": False})  # parsing may read files
    connection.execute("SET errors_as_json = true")
    try:
        connection.extract_statements(before + sql)
    except duckdb.Error as error:
        found = re.search(r'"position":"(\d+)"', str(error))
        if found:
            position = int(found.group(1))
            if int(duckdb.__version__.partition(".")[0]) > 1:  # bytes; DuckDB 1 counts characters
                position = len((before + sql).encode()[:position].decode(errors="ignore"))
            return f" (character {position - len(before) + 1})"
    finally:
        connection.close()
    return ""


def shows_every_column(connection: duckdb.DuckDBPyConnection, sql: str) -> bool:
    """Return whether a query selects all columns (``*``, ``COLUMNS``) or whole rows by a table's name.

    True if DuckDB cannot serialise the query.
    """
    nodes, is_unknown = _parsed(connection, sql)
    sources = {node["alias"] or node["table_name"] for node in nodes if node.get("type") == "BASE_TABLE"}
    named = {node["column_names"][0] for node in nodes if len(node.get("column_names", ())) == 1}
    is_row = not {name.lower() for name in sources}.isdisjoint(name.lower() for name in named)
    return is_unknown or is_row or any(node.get("class") == "STAR" for node in nodes)


def names_both(connection: duckdb.DuckDBPyConnection, sql: str, tables: Set[str], columns: Set[str]) -> bool:
    """Return whether a query reads one of some tables and names one of some columns, of whatever table.

    True if DuckDB cannot serialise the query.
    """
    nodes, is_unknown = _parsed(connection, sql)
    has_table = any(node["table_name"].lower() in tables for node in nodes if node.get("type") == "BASE_TABLE")
    named = {node["column_names"][-1].lower() for node in nodes if node.get("column_names")}
    return is_unknown or (has_table and not named.isdisjoint(columns))


def _parsed(connection: duckdb.DuckDBPyConnection, sql: str) -> tuple[list[dict[str, Any]], bool]:
    """Return the nodes of a query as DuckDB parses it, and whether it cannot serialise them."""
    (answer,) = connection.execute("SELECT json_serialize_sql($1::VARCHAR)", [sql]).fetchall()[0]
    tree = json.loads(answer)
    return list(_nodes(tree)), tree["error"]


def _nodes(tree: Any) -> Iterator[dict[str, Any]]:
    """Yield every object in a JSON tree."""
    if isinstance(tree, dict):
        yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for part in tree:
            yield from _nodes(part)


def words(sql: str) -> set[str]:
    """Return all tokens of a query that may be names, in lower case."""
    return set(re.findall(r"[a-z_][a-z0-9_]*", sql.lower()))


def quoted(text: str) -> str:
    """Return an SQL literal of a text."""
    return "'" + text.replace("'", "''") + "'"


@contextmanager
def explaining(where: str, user_columns: Iterable[str] = ()) -> Iterator[None]:
    """Add position and suggestions to errors of DuckDB about unknown columns.

    Args:
        where: The condition that is run.
        user_columns: User columns of the lake.
    """
    try:
        yield
    except QueryError as error:
        found = _UNKNOWN_COLUMN.search(str(error))
        word = re.search(rf"\b{re.escape(found.group(1))}\b", where, re.IGNORECASE) if found else None
        if word is None:
            raise
        similar = similar_columns(where, user_columns)
        raise QueryError(f"no column {word.group()} at character {word.start() + 1} of {where!r}; {similar}") from error


def quoting_hint(message: str, sql: str) -> str:
    """What to add to an error of DuckDB about an unknown column that something is compared with: it may be a text."""
    found = _UNKNOWN_COLUMN.search(message)
    is_compared = found and re.search(rf"(?:[=<>]|\bLIKE\b|\bIN\s*\()\s*{re.escape(found[1])}\b", sql, re.IGNORECASE)
    return f"\na text is written in quotes, '{found[1]}'" if found and is_compared else ""


def similar_columns(where: str, user_columns: Iterable[str] = ()) -> str:
    """Suggest columns with names similar to the unknown names in a condition."""
    metadata = tables.load("metadata")
    columns = [column.name for column in (*metadata.columns, *metadata.derived)] + list(user_columns)
    unknown = {word.lower() for word in re.findall(r"[A-Za-z_]\w*", where)} - set(columns)
    near = [name for word in sorted(unknown) for name in difflib.get_close_matches(word, columns, n=3, cutoff=0.5)]
    hint = f"similar: {', '.join(dict.fromkeys(near))}; " if near else ""
    compared = re.findall(r"(?:[=<>(,]|\b(?:IN|LIKE)\b)\s*([A-Za-z_]\w*)\b(?!\s*\()", where, re.IGNORECASE)
    texts = [word for word in compared if word.lower() in unknown]
    if texts:
        hint = f"a text is written in quotes, '{texts[0]}'; {hint}"
    return f"{hint}`scenarionet info filters --columns` explains all columns"
