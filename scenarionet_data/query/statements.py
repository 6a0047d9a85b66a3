"""What a person typed as SQL: that it can only read, what it names, and where the parser stumbles over it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

import duckdb

from scenarionet_data.errors import QueryError, UnsafeSql


def only_select(connection: duckdb.DuckDBPyConnection, sql: str, given: Mapping[str, Any]) -> str:
    """The query as one that can only read; everything but a single SELECT with its parameters is refused.

    As a subquery, because at the top level ``WITH x AS (COPY ... TO ...) SELECT`` is a SELECT that writes.

    Args:
        connection: A locked one, because parsing may read files.
        sql: What was typed.
        given: Values for ``$name`` in it.

    Raises:
        UnsafeSql: It is more or other than one SELECT.
        QueryError: A parameter has no value.
    """
    statements = connection.extract_statements(sql)
    if len(statements) != 1:
        raise UnsafeSql(f"wanted one SELECT, found {len(statements)} statements")
    kind = statements[0].type
    if kind != duckdb.StatementType.SELECT:
        raise UnsafeSql(f"wanted one SELECT, found {kind.name}: a query only reads the lake")
    missing = sorted(statements[0].named_parameters - given.keys())
    if missing:
        raise QueryError(f"no value for ${', $'.join(missing)}: give each parameter of the query one")
    text = statements[0].query.rstrip().rstrip(";")
    return f"SELECT * FROM (\n{text}\n)"


def check_expression(where: str) -> None:
    """Refuse everything but a single expression, as in ``--where``.

    Raises:
        UnsafeSql: It is not one expression; the message is DuckDB's.
    """
    try:
        duckdb.SQLExpression(where)
    except duckdb.Error as error:
        place = place_of_mistake(where, "SELECT ")
        raise UnsafeSql(f"wanted one condition such as ego_distance > 10, found {where!r}: {error}{place}") from error


def place_of_mistake(sql: str, before: str = "") -> str:
    """Which character the parser stumbles over, from 1, in words; nothing when it does not say.

    Args:
        sql: What was typed.
        before: What makes a statement of it.
    """
    connection = duckdb.connect(config={"enable_external_access": False})  # parsing may read files
    connection.execute("SET errors_as_json = true")
    try:
        connection.extract_statements(before + sql)
    except duckdb.Error as error:
        found = re.search(r'"position":"(\d+)"', str(error))
        if found:
            place = int(found.group(1))
            if int(duckdb.__version__.partition(".")[0]) > 1:  # counts bytes, where DuckDB 1 counted characters
                place = len((before + sql).encode()[:place].decode(errors="ignore"))
            return f" (character {place - len(before) + 1})"
    finally:
        connection.close()
    return ""


def shows_every_column(connection: duckdb.DuckDBPyConnection, sql: str) -> bool:
    """Whether a query asks a table for every column (``*``, ``COLUMNS``), or for whole rows by the table's name.

    True where DuckDB cannot tell how the query is built.
    """
    (answer,) = connection.execute("SELECT json_serialize_sql($1::VARCHAR)", [sql]).fetchall()[0]
    tree = json.loads(answer)
    nodes = list(_nodes(tree))
    tables = {node["alias"] or node["table_name"] for node in nodes if node.get("type") == "BASE_TABLE"}
    named = {node["column_names"][0] for node in nodes if len(node.get("column_names", ())) == 1}
    is_row = not {name.lower() for name in tables}.isdisjoint(name.lower() for name in named)
    return tree["error"] or is_row or any(node.get("class") == "STAR" for node in nodes)


def _nodes(tree: Any) -> Iterator[dict[str, Any]]:
    """Every object in a JSON tree."""
    if isinstance(tree, dict):
        yield tree
        tree = list(tree.values())
    if isinstance(tree, list):
        for part in tree:
            yield from _nodes(part)


def words(sql: str) -> set[str]:
    """Every word of a query that may be a name, in lower case."""
    return set(re.findall(r"[a-z_][a-z0-9_]*", sql.lower()))


def quoted(text: str) -> str:
    """A text as SQL writes it."""
    return "'" + text.replace("'", "''") + "'"
