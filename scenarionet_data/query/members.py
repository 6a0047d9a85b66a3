"""Addresses of scenarios in a snapshot, and SQL for the members of databases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pyarrow as pa

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import quoted
from scenarionet_data.schema.tables import DESCRIPTION_COLUMNS
from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS

if TYPE_CHECKING:
    from scenarionet_data.query.engine import Engine, Rows


class StaleDatabaseWarning(UserWarning):
    """Members of a database changed in a later snapshot; it is read from the snapshot it was made on.

    Args:
        message: The warning, with its remedy for Python.
        cli_remedy: Command with the same effect as the remedy.
    """

    def __init__(self, message: str, cli_remedy: str = "") -> None:
        super().__init__(message)
        self.cli_remedy = cli_remedy


def known_rows(database: DatabaseRecord, whole: RowSets | None) -> RowSets | None:
    """Return the members by their rows in a snapshot; None if they have none there.

    Args:
        database: The members.
        whole: All scenarios of the snapshot by their rows, if they are many.
    """
    return None if whole is None or database.rows is None else database.rows.among(whole)


def relation(database: DatabaseRecord, whole: RowSets | None, table: str = "selected") -> tuple[str, dict[str, Rows]]:
    """Return SQL for the rows of a database, and the tables it needs.

    Args:
        database: Saved ones are read from their file; the members of an unsaved selection are a table in memory. Those
            that are rows are joined with the view metadata.
        whole: All scenarios of the snapshot that is queried by their rows, if they are many.
        table: Name of that table.
    """
    rows = known_rows(database, whole)
    if rows is not None:
        columns = "scenario_id, position, 1.0::DOUBLE AS weight, content_hash"
        return f"(SELECT {columns} FROM metadata JOIN {table} USING (lake_row))", {table: rows.places(database.files)}
    if database.selected is None and database.rows is None:
        return f"read_parquet({quoted(str(database.files.verified(database.file)))})", {}
    return table, {table: database.members}


def count_changed(engine: Engine, database: DatabaseRecord, whole: RowSets | None = None) -> tuple[int, str]:
    """Return how many members a snapshot lacks or has with other content, and the id of one of them.

    Ids are compared by hash together with the content hash (128 bits): text ids of a million members take 70 MB more.
    Rows of the same files are unchanged.

    Args:
        engine: The snapshot.
        database: The members.
        whole: All scenarios of the snapshot by their rows, if they are many.
    """
    if known_rows(database, whole) is not None:
        return 0, ""
    members, tables = relation(database, None)
    query = (
        "SELECT count(*) AS n, min(scenario_id) AS example "
        f"FROM (SELECT scenario_id, hash(scenario_id) AS id_hash, content_hash FROM {members}) "
        "ANTI JOIN (SELECT hash(scenario_id) AS id_hash, content_hash FROM metadata_rows) USING (id_hash, content_hash)"
    )
    (row,) = engine.arrow(query, tables=tables).to_pylist()
    return row["n"], row["example"]


def locate(engine: Engine, wanted: pa.Table) -> pa.Table:
    """Return address and description columns of scenarios, one row per row of ``wanted``, in its order.

    Args:
        engine: Engine of the snapshot.
        wanted: Column scenario_id, and content_hash if changed content counts as missing.

    Returns:
        Columns as stored in the files, and ``is_found``: False if the snapshot does not have the scenario, or
        (with a content_hash) has other content under its id.
    """
    numbered = wanted.append_column("_row", pa.array(range(wanted.num_rows), pa.int64()))
    same = " AND m.content_hash = w.content_hash" if "content_hash" in wanted.column_names else ""
    columns = ", ".join(f"m.{name}" for name in (*DESCRIPTION_COLUMNS[1:], "content_hash", *ADDRESS_COLUMNS))
    query = (
        f"SELECT w.scenario_id, {columns}, m.scenario_id IS NOT NULL AS is_found "
        f"FROM wanted w LEFT JOIN metadata_rows m ON m.scenario_id = w.scenario_id{same} ORDER BY w._row"
    )
    return engine.arrow(query, tables={"wanted": numbered})


def as_ids(scenarios: Iterable[str]) -> pa.Array:
    """Return scenario ids as Arrow has them.

    Raises:
        BadParameter: They are no texts.
    """
    listed = list(scenarios) if isinstance(scenarios, Iterable) else [scenarios]
    try:
        return pa.array(listed, pa.string())
    except pa.ArrowTypeError as error:
        raise BadParameter(f"expected a database, its name, or scenario ids, found {scenarios!r}") from error
