"""DuckDB, behind one module: views over a snapshot, locked so that a user's SQL can only read them.

Works with DuckDB 1.5 and 2. No extension is loaded or downloaded.
"""

from __future__ import annotations

import re
import tempfile
import threading
import uuid
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import duckdb
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import tables
from scenarionet_data.errors import LakeError, QueryError, UnsafeSql
from scenarionet_data.resources import SQL
from scenarionet_data.store import runs
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles, is_url
from scenarionet_data.store.snapshot import Snapshot

if TYPE_CHECKING:
    import polars as pl

_ROWS_PER_BATCH = 65_536
FILE_TABLES = ("metadata", "tracks", "lights", "maps", "quarantine", "shards", *runs.RUN_TABLES)
_FOLDER_COLUMNS = ("tracks", "lights", "maps")
_KEYS = {"metadata": "scenario_id", "tracks": "scenario_id", "lights": "scenario_id", "maps": "map_id"}

Rows: TypeAlias = pa.Table | pa.RecordBatchReader
"""What a question may bring along; a reader's rows are read once."""


def table_files(files: LakeFiles, snapshot: Snapshot, table: str) -> list[str]:
    """Files of one of FILE_TABLES in a snapshot; what runs left belongs to every snapshot."""
    if table == "metadata":
        return list(snapshot.metadata)
    if table in runs.RUN_TABLES:
        return runs.part_files(files, table)
    if table == "shards":
        return list(snapshot.manifests)
    listed = pc.unique(pc.list_flatten(snapshots.column(files, snapshot, "files")))  # shards may share files
    return sorted(listed.filter(pc.starts_with(listed, f"{table}/")).to_pylist())


class Engine:
    """One locked DuckDB connection over one snapshot; views come into being when a query names them.

    Threads may share it: their queries run one after the other.

    Args:
        files: The lake's files.
        snapshot: What the views show.
        without: Files of the snapshot that the views leave out, for example because they are gone.
        given: Tables that every question brings along (see :meth:`arrow`), in place of the snapshot's.
        threads: Threads of a query; one a core unless given.
        layers: Version of each layer of users' columns that the view metadata has for queries that ask for it.
        only: Scenarios that the views show, with their addresses; all of the snapshot's for None.

    Raises:
        SchemaMismatch: The snapshot holds files of another version of the contract.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        without: Iterable[str] = (),
        given: Iterable[str] = (),
        threads: int | None = None,
        layers: Mapping[str, int] | None = None,
        only: pa.Table | None = None,
    ) -> None:
        snapshots.check_schemas(files, snapshot)
        self._files = files
        self._snapshot = snapshot
        self._without = set(without)
        self._layers = dict(layers or {})
        self._joined: frozenset[str] = frozenset()
        self._only = only
        self._connection = duckdb.connect(config={"autoinstall_known_extensions": False})
        self._views = set(given)
        self._filesystem: Any = files.filesystem() if is_url(files.root) else None
        if self._filesystem:  # before its folders are allowed: DuckDB 1.5 would take them for folders here
            self._connection.register_filesystem(self._filesystem)
        self._lock = threading.Lock()
        # In a notebook without ipywidgets it is off, and DuckDB refuses to turn it off again.
        if self._connection.execute("SELECT current_setting('enable_progress_bar')").fetchall() == [(True,)]:
            self._connection.execute("SET enable_progress_bar = false")
        # Where the engine has an allocator of its own: memory that a query has used goes back to the system.
        self._connection.execute("SET allocator_background_threads = true")
        if threads:
            self._connection.execute(f"SET threads = {threads}")
        if only is not None:
            self._connection.register("chosen", only.select(["scenario_id", "map_id"]))
        # Large queries spill to disk: not into the working directory, and apart from other processes.
        spill = Path(tempfile.gettempdir()) / f"scenarionet-{uuid.uuid4().hex}"
        self._connection.execute(f"SET temp_directory = {_quoted(str(spill))}")
        folders = ", ".join(map(_quoted, files.scanned_folders))
        self._connection.execute(f"SET allowed_directories = [{folders}]")
        self._connection.execute("SET enable_external_access = false")
        self._connection.execute("SET lock_configuration = true")

    def close(self) -> None:
        """Release the connection."""
        self._connection.close()

    def interrupt(self) -> None:
        """Stop the question that is being answered, from another thread; it fails with a QueryError."""
        self._connection.interrupt()

    def select(self, sql: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Run one SELECT and return its rows.

        Args:
            sql: One reading statement over the views in ``sql/views``.
            parameters: Values for ``$name`` in it.

        Raises:
            UnsafeSql: More than one statement, or one that is not a SELECT.
            QueryError: DuckDB does not understand it; the message is DuckDB's.
        """
        import polars  # here: filters need no data frames, and it takes 25 MB

        rows = self.arrow(sql, parameters)
        try:
            return polars.DataFrame(rows)
        except polars.exceptions.PolarsError as error:
            raise QueryError(f"{error}; name columns apart with AS, cast odd types to VARCHAR") from error

    def arrow(
        self,
        sql: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        layers: Iterable[str] | None = None,
        **tables: Rows,
    ) -> pa.Table:
        """Like :meth:`select`, as an Arrow table.

        Args:
            sql, parameters: See :meth:`select`.
            layers: Those the query asks; told from the query unless given.
            **tables: Known to this query by their names.

        Raises:
            LakeError: A file is gone or cannot be read.
        """
        with self._asked(sql, tables):
            given = dict(parameters or {})
            query = self._only_select(sql, given)
            self._make_views(sql, layers)
            return self._connection.sql(query, params=given).to_arrow_table()

    def batches(
        self, sql: str, parameters: Mapping[str, Any] | None = None, *, layers: Iterable[str] | None = None
    ) -> Generator[pa.RecordBatch, None, None]:
        """Like :meth:`arrow`, some rows at a time; every other question waits until it is closed, or at its end."""
        with self._asked(sql, {}):
            given = dict(parameters or {})
            query = self._only_select(sql, given)
            self._make_views(sql, layers)
            rows = self._connection.sql(query, params=given).to_arrow_reader(_ROWS_PER_BATCH)
            try:
                yield from rows
            except OSError as error:  # what goes wrong between two batches passes through Arrow
                kind = duckdb.IOException if "IO Error" in str(error) else duckdb.Error
                raise kind(str(error)) from error

    def fetch(self, sql: str, **tables: Rows) -> list[tuple[Any, ...]]:
        """Rows of a query of our own, which is known to only read; half the time of :meth:`arrow` on few rows.

        Raises:
            LakeError: A file is gone or cannot be read.
        """
        with self._asked(sql, tables):
            self._make_views(sql)
            return self._connection.execute(sql).fetchall()

    @contextmanager
    def _asked(self, sql: str, tables: Mapping[str, Rows]) -> Iterator[None]:
        """Holds the connection for one question, which knows ``tables``."""
        # A connection answers one query at a time.
        with snapshots.reading_from(self._files, self._snapshot), self._lock:
            for name, rows in tables.items():
                self._connection.register(name, rows)
            try:
                yield
            except duckdb.IOException as error:
                remedy = f"`scenarionet check {self._files.root}` says what is gone or damaged"
                message, _, excerpt = str(error).partition("\n")
                raise LakeError(f"{message}; {remedy}\n{excerpt}".rstrip()) from error
            except duckdb.ParserException as error:
                message, _, excerpt = str(error).partition("\n")
                raise QueryError(f"{message}{_place_of_mistake(sql)}\n{excerpt}") from error
            except duckdb.Error as error:
                failure = self._filesystem and self._filesystem.pop_failure()
                raise failure or QueryError(str(error)) from error
            finally:
                for name in tables:
                    self._connection.unregister(name)

    def _only_select(self, sql: str, given: Mapping[str, Any]) -> str:
        """The query as one that can only read; everything but a single SELECT with its parameters is refused.

        Parsed on this locked connection, because parsing may read files; as a subquery, because at the top level
        ``WITH x AS (COPY ... TO ...) SELECT`` is a SELECT that writes.
        """
        statements = self._connection.extract_statements(sql)
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

    def _make_views(self, sql: str, layers: Iterable[str] | None = None) -> None:
        """Create the views and macros whose names occur in ``sql``, those they need first."""
        if self._layers and "metadata" in words(sql):
            self._join_layers(frozenset(self._asked_layers(sql) if layers is None else layers))
        defined = _definitions()
        for name in sorted(words(sql) & set(defined)):
            self._make_view(name, defined)

    def _asked_layers(self, sql: str) -> Iterable[str]:
        """Layers that a query names; all, where it asks for every column or for whole rows."""
        (tree,) = self._connection.execute("SELECT json_serialize_sql($1::VARCHAR)", [sql]).fetchall()[0]
        is_all = any(sign in tree for sign in ('"class":"STAR"', '"column_names":["metadata"]', '"error":true'))
        return self._layers if is_all else words(sql) & set(self._layers)

    def _join_layers(self, names: frozenset[str]) -> None:
        """Let the view metadata have these layers: a join of a layer takes time, whether it is looked at or not."""
        if names != self._joined and "metadata" in self._views:
            self._connection.execute("DROP VIEW metadata")
            self._views.remove("metadata")
        self._joined = names

    def _make_view(self, name: str, defined: Mapping[str, Path]) -> None:
        if name in self._views:
            return
        text = defined[name].read_text("utf-8")
        needs = re.search(r"^-- needs: (.*)$", text, re.MULTILINE)
        for needed in needs.group(1).split(", ") if needs else []:
            self._make_view(needed, defined)
        table = name.removesuffix("_rows")
        if table in FILE_TABLES:
            text = text.replace("{files}", self._relation(table)).replace("{derived}", _derived(table))
            text = text.replace("{layers}", self._layer_joins())
        self._connection.execute(text)
        if name in FILE_TABLES:
            self._comment(name)
        self._views.add(name)

    def _comment(self, name: str) -> None:
        """Give the view and its columns the contract's words, for ``duckdb_columns()`` and SQL clients."""
        table = tables.load(name)
        comments = [f"COMMENT ON VIEW {name} IS {_quoted(table.doc)}"]
        for column in (*table.columns, *table.derived):
            words = column.doc + (f" [{column.unit}]" if column.unit else "")
            comments.append(f"COMMENT ON COLUMN {name}.{column.name} IS {_quoted(words)}")
        self._connection.execute("; ".join(comments))

    def _relation(self, table: str) -> str:
        """SQL for a table's files: a scan, or no rows of the right types when there are none."""
        listed = self._chosen_files(table)
        names = [name for name in listed if name not in self._without]
        if not names:
            columns = [f"NULL::{_sql_type(c)} AS {c.name}" for c in tables.load(table).columns]
            folders = ["NULL::VARCHAR AS " + name for name in _hive_columns(table)]
            return f"(SELECT {', '.join(columns + folders)} WHERE false)"
        paths = self._files.scans(names)
        self._connection.execute(f"SET VARIABLE {table}_files = $paths", {"paths": paths})
        hive = str(table in _FOLDER_COLUMNS).lower()
        scan = f"read_parquet(getvariable('{table}_files'), hive_partitioning = {hive}" + (
            ", hive_types_autocast = false)" if table in _FOLDER_COLUMNS else ")"
        )
        if self._only is None or table not in _KEYS:
            return scan
        return f"(SELECT * FROM {scan} SEMI JOIN chosen USING ({_KEYS[table]}))"

    def _chosen_files(self, table: str) -> list[str]:
        """A table's files; of chosen scenarios, those that hold a part of one."""
        listed = table_files(self._files, self._snapshot, table)
        if self._only is None or table not in ("tracks", "lights"):  # maps may be shared: their files have no address
            return listed
        wanted = set(pc.unique(self._only[f"{table}_file"]).to_pylist())
        return [name for name in listed if name in wanted]

    def _layer_joins(self) -> str:
        """SQL that joins the layers to metadata."""
        paths = {name: self._files.path(f"layers/{name}/{self._layers[name]}.parquet") for name in sorted(self._joined)}
        joins = [
            f"LEFT JOIN read_parquet({_quoted(str(path))}) AS layer_{name} USING (scenario_id)"
            for name, path in paths.items()
        ]
        return " ".join(joins)


def words(sql: str) -> set[str]:
    """Every word of a query that may be a name, in lower case."""
    return set(re.findall(r"[a-z_][a-z0-9_]*", sql.lower()))


def _definitions() -> dict[str, Path]:
    """File of each view and macro by name."""
    return {path.stem: path for folder in ("macros", "views") for path in (SQL / folder).glob("*.sql")}


def check_expression(where: str) -> None:
    """Refuse everything but a single expression, as in ``--where``.

    Raises:
        UnsafeSql: It is not one expression; the message is DuckDB's.
    """
    try:
        duckdb.SQLExpression(where)
    except duckdb.Error as error:
        place = _place_of_mistake(where, "SELECT ")
        raise UnsafeSql(f"wanted one condition such as ego_distance > 10, found {where!r}: {error}{place}") from error


def _place_of_mistake(sql: str, before: str = "") -> str:
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


def _derived(table: str) -> str:
    """SQL of the contract's derived columns, each with a comma before."""
    return "".join(f", {column.sql} AS {column.name}" for column in tables.load(table).derived)


def _hive_columns(table: str) -> Sequence[str]:
    if table not in _FOLDER_COLUMNS:
        return ()
    return ("dataset", "version") if table == "maps" else ("dataset", "split", "version")


_SQL_TYPES = {
    "bool": "BOOLEAN",
    "int8": "TINYINT",
    "int32": "INTEGER",
    "int64": "BIGINT",
    "uint64": "UBIGINT",
    "float32": "FLOAT",
    "float64": "DOUBLE",
    "string": "VARCHAR",
    "json": "VARCHAR",
    "dictionary": "VARCHAR",
}


def _sql_type(column: tables.Column) -> str:
    return _SQL_TYPES[column.element] + ("[]" if column.is_list else "")


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
