"""DuckDB over a snapshot: one connection, locked so that user SQL can only read the views of :mod:`.views`.

Works with DuckDB 1.5 and 2. No extension is loaded or downloaded.
"""

from __future__ import annotations

import tempfile
import threading
import uuid
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import duckdb
import pyarrow as pa

from scenarionet_data.errors import LakeError, QueryError
from scenarionet_data.query.damage import damage
from scenarionet_data.query.statements import error_position, only_select, quoted, quoting_hint
from scenarionet_data.query.views import Views
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

if TYPE_CHECKING:
    import polars as pl

_ROWS_PER_BATCH = 65_536

Rows: TypeAlias = pa.Table | pa.RecordBatchReader
"""A table that a query may use; the rows of a reader are read once."""


class Engine:
    """One locked DuckDB connection over one snapshot; views are created when a query names them.

    Threads may share an engine: their queries run one after the other.

    Args:
        files: Files of the lake.
        snapshot: Snapshot that the views show.
        without: Files of the snapshot that the views leave out, for example missing ones.
        given: Tables that every query passes (see :meth:`arrow`) in place of the snapshot's.
        threads: Threads of a query; one per core by default.
        max_memory: Memory of queries [bytes]; 80 % of the machine's by default.
        user_columns: Version of each user column that the view metadata has for queries that use it.
        chosen: Scenarios that the views show, with their addresses; all of the snapshot by default.

    Raises:
        SchemaMismatch: The snapshot has files of another version of the contract.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        without: Iterable[str] = (),
        given: Iterable[str] = (),
        threads: int | None = None,
        max_memory: int | None = None,
        user_columns: Mapping[str, int] | None = None,
        chosen: pa.Table | None = None,
    ) -> None:
        schemas = manifests.schema_versions(files, snapshot)
        self._files = files
        self._snapshot = snapshot
        try:
            self._connection = duckdb.connect(config={"autoinstall_known_extensions": False})
        except duckdb.Error as error:  # DuckDB reserves address space for its buffers and threads
            raise _out_of_memory(error) from error
        if chosen is not None:
            self._connection.register("chosen", chosen.select(["scenario_id", "map_id"]))
        self._views = Views(
            self._connection, files, snapshot, set(without), set(given), user_columns or {}, chosen, schemas
        )
        self._filesystem: Any = files.filesystem()
        if self._filesystem:  # before allowed_directories: DuckDB 1.5 would take its URLs for local folders
            self._connection.register_filesystem(self._filesystem)
        self._lock = threading.Lock()
        # Configure and lock the connection: from here on it can only read files of the lake.
        # In a notebook without ipywidgets the bar is off already, and DuckDB raises when it is turned off again.
        if self._connection.execute("SELECT current_setting('enable_progress_bar')").fetchall() == [(True,)]:
            self._connection.execute("SET enable_progress_bar = false")
        # Return memory of finished queries to the system where DuckDB has its own allocator.
        self._connection.execute("SET allocator_background_threads = true")
        if threads:
            self._connection.execute(f"SET threads = {threads}")
        if max_memory:
            self._connection.execute(f"SET memory_limit = '{max_memory} B'")
        # Large queries spill to disk: not into the working directory, and separately for each process.
        spill = Path(tempfile.gettempdir()) / f"scenarionet-{uuid.uuid4().hex}"
        self._connection.execute(f"SET temp_directory = {quoted(str(spill))}")
        folders = ", ".join(map(quoted, self._files.scanned_folders))
        self._connection.execute(f"SET allowed_directories = [{folders}]")
        self._connection.execute("SET enable_external_access = false")
        self._connection.execute("SET lock_configuration = true")

    def keep_views(self) -> None:
        """Compute the views that many relations read once from here on, and keep their rows."""
        self._views.keeps = True

    def close(self) -> None:
        """Release the connection."""
        self._connection.close()

    def interrupt(self) -> None:
        """Cancel the running query, from another thread or a signal handler; it fails with a QueryError."""
        if hasattr(self, "_connection"):  # not yet, while DuckDB starts
            self._connection.interrupt()

    def select(self, sql: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Run one SELECT and return its rows.

        Args:
            sql: One SELECT over the views in ``sql/views``.
            parameters: Values for ``$name`` in the query.

        Raises:
            UnsafeSql: It is not exactly one SELECT.
            QueryError: DuckDB rejects the query; the message is from DuckDB.
        """
        import polars  # here: filters need no data frames, and the import takes 25 MB

        rows = self.arrow(sql, parameters)
        try:
            return polars.DataFrame(rows)
        except polars.exceptions.PolarsError as error:
            raise QueryError(
                f"{error}; give columns distinct names with AS, cast unsupported types to VARCHAR"
            ) from error

    def arrow(
        self,
        sql: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        user_columns: Iterable[str] | None = None,
        tables: Mapping[str, Rows] | None = None,
    ) -> pa.Table:
        """Run one SELECT and return its rows as an Arrow table.

        Args:
            sql, parameters: See :meth:`select`.
            user_columns: User columns that the query uses; found in its text by default.
            tables: Tables that the query may use, by name.

        Raises:
            LakeError: A file is missing or cannot be read.
        """
        with self._query(sql, tables or {}):
            given = {} if parameters is None else parameters
            query = only_select(self._connection, sql, given)
            self._views.make(sql, user_columns)
            rows = self._connection.sql(query, params=dict(given)).to_arrow_table()
            return rows.cast(pa.schema([_as_text(each) for each in rows.schema])) if self._views.keeps else rows

    def batches(
        self,
        sql: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        user_columns: Iterable[str] | None = None,
        tables: Mapping[str, Rows] | None = None,
    ) -> Generator[pa.RecordBatch, None, None]:
        """Run one SELECT and yield its rows in batches; other queries wait until the generator ends or is closed."""
        with self._query(sql, tables or {}):
            given = {} if parameters is None else parameters
            query = only_select(self._connection, sql, given)
            self._views.make(sql, user_columns)
            rows = self._connection.sql(query, params=dict(given)).to_arrow_reader(_ROWS_PER_BATCH)
            try:
                yield from rows
            except OSError as error:  # errors between two batches pass through Arrow
                kind = duckdb.IOException if "IO Error" in str(error) else duckdb.Error
                raise kind(str(error)) from error

    def fetch(self, sql: str, tables: Mapping[str, Rows]) -> list[tuple[Any, ...]]:
        """Return the rows of a trusted read-only query; for few rows this takes half the time of :meth:`arrow`.

        Raises:
            LakeError: A file is missing or cannot be read.
        """
        with self._query(sql, tables):
            self._views.make(sql)
            return self._connection.execute(sql).fetchall()

    @contextmanager
    def _query(self, sql: str, tables: Mapping[str, Rows]) -> Iterator[None]:
        """Hold the connection for one query with its tables, and translate errors of DuckDB."""
        # A connection runs one query at a time.
        with snapshots.reading_from(self._files, self._snapshot), self._lock:
            for name, rows in tables.items():
                self._connection.register(name, rows)
            try:
                yield
            except duckdb.ParserException as error:
                message, _, excerpt = str(error).partition("\n")
                raise QueryError(f"{message}{error_position(sql)}\n{excerpt}") from error
            except duckdb.Error as error:
                if "Out of Memory Error" in str(error):
                    raise _out_of_memory(error) from error
                failure = self._filesystem and self._filesystem.pop_failure()
                failure = failure or damage(self._files, self._views.scanned, error, sql)
                if failure is None and isinstance(error, duckdb.IOException):
                    remedy = f"`scenarionet maintain check {self._files.root}` lists missing and damaged files"
                    message, _, excerpt = str(error).partition("\n")
                    failure = LakeError(f"{message}; {remedy}\n{excerpt}".rstrip())
                raise failure or QueryError(f"{error}{quoting_hint(str(error), sql)}") from error
            except RuntimeError as error:
                if str(error) == "Query interrupted":  # how DuckDB reports an exception of a signal handler
                    raise KeyboardInterrupt from error
                raise
            finally:
                for name in tables:
                    self._connection.unregister(name)


def _out_of_memory(error: Exception) -> QueryError:
    """Return the error for a query that needs more memory than it gets."""
    found = str(error).partition("\n")[0]
    return QueryError(
        f"{found}; select fewer rows and columns, or give the query more memory, with Lake(..., max_memory=...), a "
        "higher `ulimit -v` or a larger machine"
    )


def _as_text(column: pa.Field) -> pa.Field:
    """Return a column with texts for ids that are kept as numbers."""
    return column.with_type(column.type.value_type) if pa.types.is_dictionary(column.type) else column
