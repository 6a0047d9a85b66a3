"""DuckDB over a snapshot: one connection, locked so that a user's SQL can only read the views of :mod:`.views`.

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
from scenarionet_data.query.statements import only_select, place_of_mistake, quoted
from scenarionet_data.query.views import Views
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.opening import is_url
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

if TYPE_CHECKING:
    import polars as pl

_ROWS_PER_BATCH = 65_536

Rows: TypeAlias = pa.Table | pa.RecordBatchReader
"""What a question may bring along; a reader's rows are read once."""


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
        manifests.check_schemas(files, snapshot)
        self._files = files
        self._snapshot = snapshot
        self._connection = duckdb.connect(config={"autoinstall_known_extensions": False})
        self._views = Views(
            self._connection, files, snapshot, without=without, given=given, layers=layers or {}, only=only
        )
        self._filesystem: Any = files.filesystem() if is_url(files.root) else None
        if self._filesystem:  # before its folders are allowed: DuckDB 1.5 would take them for folders here
            self._connection.register_filesystem(self._filesystem)
        self._lock = threading.Lock()
        self._settle(threads)

    def _settle(self, threads: int | None) -> None:
        """Set the connection up, and lock it: from here on it reads the lake's files and nothing else."""
        # In a notebook without ipywidgets it is off, and DuckDB refuses to turn it off again.
        if self._connection.execute("SELECT current_setting('enable_progress_bar')").fetchall() == [(True,)]:
            self._connection.execute("SET enable_progress_bar = false")
        # Where the engine has an allocator of its own: memory that a query has used goes back to the system.
        self._connection.execute("SET allocator_background_threads = true")
        if threads:
            self._connection.execute(f"SET threads = {threads}")
        # Large queries spill to disk: not into the working directory, and apart from other processes.
        spill = Path(tempfile.gettempdir()) / f"scenarionet-{uuid.uuid4().hex}"
        self._connection.execute(f"SET temp_directory = {quoted(str(spill))}")
        folders = ", ".join(map(quoted, self._files.scanned_folders))
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
            query = only_select(self._connection, sql, given)
            self._views.make(sql, layers)
            return self._connection.sql(query, params=given).to_arrow_table()

    def batches(
        self, sql: str, parameters: Mapping[str, Any] | None = None, *, layers: Iterable[str] | None = None
    ) -> Generator[pa.RecordBatch, None, None]:
        """Like :meth:`arrow`, some rows at a time; every other question waits until it is closed, or at its end."""
        with self._asked(sql, {}):
            given = dict(parameters or {})
            query = only_select(self._connection, sql, given)
            self._views.make(sql, layers)
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
            self._views.make(sql)
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
                raise QueryError(f"{message}{place_of_mistake(sql)}\n{excerpt}") from error
            except duckdb.Error as error:
                failure = self._filesystem and self._filesystem.pop_failure()
                raise failure or QueryError(str(error)) from error
            finally:
                for name in tables:
                    self._connection.unregister(name)
