"""Views over the files of a snapshot, created when a query names them, from ``sql/views`` and ``sql/macros``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from itertools import filterfalse
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.query.statements import names_both, quoted, shows_every_column, words
from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SQL
from scenarionet_data.storage import evaluation_runs, kept_moments
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.snapshot import Snapshot

if TYPE_CHECKING:
    import duckdb

FILE_TABLES = (
    "metadata",
    "tracks",
    "lights",
    "maps",
    "quarantine",
    "defects",
    "shards",
    "moments",
    *evaluation_runs.RUN_TABLES,
)
_HIVE_COLUMNS = {"maps": ("dataset", "version"), **dict.fromkeys(("tracks", "lights"), ("dataset", "split", "version"))}
"""Columns that are in the names of folders."""
_NEEDS = re.compile(r"^-- needs: (.*)$", re.MULTILINE)
_ANY_TIME = {"moments", "moments_rows", *evaluation_runs.RUN_TABLES}
"""Views of files that are written beside the snapshot."""
_COMMENT_TABLES = {"duckdb_columns", "duckdb_views", "information_schema", "pg_description"}
_LANE_COLUMNS = {"lane_id", "lane_type", "lane_offset"}
_LANES = {
    "states": ("state_lanes", "scenario_id, track_id, timestep"),
    "objects": ("track_lanes", "scenario_id, track_id"),
}
"""Views that have the lanes of another one, by their keys, for queries that name one of LANE_COLUMNS: finding lanes
takes ten times as long as everything else in them. No other view uses these two."""
_NUMBERED = {
    "metadata_rows": {"scenario_id": "scenario_number", "ego_id": "track_number"},
    "tracks": {"scenario_id": "scenario_number", "track_id": "track_number"},
}
"""Views whose rows are kept with ids of these types (ENUM)."""
_FUNCTIONS = ("track_motion", "lanes_along", "outline_gaps")
"""Functions of Arrow arrays that views need; each is in a module of its name, with its types in SQL."""
_ROW = "lake_row"
"""Column of the view metadata for queries that name it: number of the file << 32 | row in the file."""
_KEYS = {"metadata": "scenario_id", "tracks": "scenario_id", "lights": "scenario_id", "maps": "map_id"}


def table_files(files: LakeFiles, snapshot: Snapshot, table: str) -> list[str]:
    """Return the files of one of FILE_TABLES in a snapshot; results of runs and moments belong to every snapshot."""
    if table == "metadata":
        return list(snapshot.metadata)
    if table in evaluation_runs.RUN_TABLES:
        return evaluation_runs.part_files(files, table)
    if table == "moments":
        return kept_moments.part_files(files)
    if table == "shards":
        return list(snapshot.manifests)
    lists = manifests.column(files, snapshot, "files").chunks
    return sorted({name for each in lists for name in each.values.to_pylist() if name.startswith(f"{table}/")})


@dataclass
class Views:
    """The views and macros of one connection.

    Attributes:
        connection: Connection that the views are created on.
        files: Files of the lake.
        snapshot: Snapshot that the views show.
        without: Files of the snapshot that the views leave out.
        given: Tables that every query passes in place of the snapshot's.
        user_columns: Version of each user column that the view metadata has for queries that use it.
        chosen: Scenarios that the views show, with their addresses; all of the snapshot for None. The connection has
            them as ``chosen``.
        keeps: Whether the rows of views that say so (``-- kept:``) are computed once and kept.
        schemas: Versions of tables, as ``tracks/1``, that all files of the snapshot have.
        scanned: Files that the views read, in order.
    """

    connection: duckdb.DuckDBPyConnection
    files: LakeFiles
    snapshot: Snapshot
    without: Set[str]
    given: Set[str]
    user_columns: Mapping[str, int]
    chosen: pa.Table | None
    schemas: Set[str]
    keeps: bool = False
    scanned: dict[str, None] = field(default_factory=dict)
    _made: set[str] = field(default_factory=set)
    _commented: set[str] = field(default_factory=set)
    _joined: frozenset[str] = frozenset()
    _has_lanes: bool = False

    def make(self, sql: str, user_columns: Iterable[str] | None = None) -> None:
        """Create the views and macros that a query names, after those they depend on.

        Args:
            sql: The query.
            user_columns: User columns that it uses; found in its text by default.
        """
        if "metadata" in words(sql):
            if user_columns is None:
                is_all = self.user_columns and shows_every_column(self.connection, sql)
                user_columns = self.user_columns if is_all else words(sql) & set(self.user_columns)
            joined = frozenset(user_columns) | words(sql) & {_ROW}
            if joined != self._joined and "metadata" in self._made:  # a join costs time even if its column is unused
                self._drop("metadata")
            self._joined = joined
        defined = _definitions()
        if not words(sql).isdisjoint(_ANY_TIME):
            for name in sorted(_ANY_TIME & self._made):  # moments before their rows
                self._drop(name)
        if words(sql) & _LANES.keys():
            has_lanes = names_both(self.connection, sql, _LANES.keys(), _LANE_COLUMNS)
            if has_lanes != self._has_lanes:
                self._has_lanes = has_lanes
                for name in sorted(_LANES.keys() & self._made):
                    self._drop(name)
        for name in sorted(words(sql) & set(defined)):
            self._make(name, defined)
        if words(sql) & _COMMENT_TABLES:  # only on demand: comments take a third of the time of a first query
            for name in sorted(self._made - self._commented):
                self._comment(name)

    def _drop(self, name: str) -> None:
        self.connection.execute(f"DROP VIEW {name}")
        self._made.remove(name)
        self._commented.discard(name)

    def _make(self, name: str, defined: Mapping[str, Path]) -> None:
        if name in self._made or name in self.given:
            return
        if name in _FUNCTIONS:
            from duckdb.func import FunctionNullHandling, PythonUDFType  # here: a loader needs no DuckDB

            module = import_module(f"{__package__}.{name}")  # here: few queries need what it imports
            self.connection.create_function(
                name,
                getattr(module, name),
                list(module.PARAMETERS),
                module.RETURNS,
                type=PythonUDFType.ARROW,
                null_handling=FunctionNullHandling.SPECIAL,
            )
            self._made.add(name)
            return
        text = defined[name].read_text("utf-8")
        needs = _NEEDS.search(text)
        for needed in needs[1].split(", ") if needs else []:
            self._make(needed, defined)
        table = name.removesuffix("_rows")
        if table in FILE_TABLES:
            text = text.replace("{files}", self._relation(table)).replace("{derived}", tables.load(table).derived_sql)
        if name == "metadata":
            joins = []
            for column in sorted(self._joined - {_ROW}):
                file = f"layers/{column}/{self.user_columns[column]}.parquet"
                path = self.files.verified(file)
                self.scanned[file] = None
                joins.append(f"LEFT JOIN read_parquet({quoted(str(path))}) AS user_{column} USING (scenario_id)")
            row = f", files.file_index::BIGINT * 4294967296 + files.file_row_number AS {_ROW}"
            text = text.replace("{row}", row if _ROW in self._joined else "")
            text = text.replace("{user_columns}", " ".join(joins))
        if self._has_lanes and name in _LANES:
            self._make(_LANES[name][0], defined)
            text = text.replace("{lanes}", "LEFT JOIN {} USING ({})".format(*_LANES[name]))
        text = text.replace("{lanes}", "")
        if self.keeps and name in _NUMBERED:
            text = self._numbered(name, text)
        elif self.keeps and "-- kept:" in text:
            text = text.replace("CREATE VIEW", "CREATE TEMP TABLE", 1)
        self.connection.execute(text)
        self._made.add(name)

    def _numbered(self, name: str, text: str) -> str:
        """Return SQL that keeps the rows of a view of files, with ids as numbers, which join and sort faster."""
        if not _NUMBERED.keys() & self._made:  # the types of both, before the first of them
            metadata, tracks = self._relation("metadata"), self._relation("tracks")
            owners = f"SELECT track_id FROM {tracks} UNION SELECT ego_id FROM {metadata} WHERE ego_id IS NOT NULL"
            self.connection.execute(
                f"CREATE TYPE scenario_number AS ENUM (SELECT scenario_id FROM {metadata} ORDER BY 1)"
            )
            self.connection.execute(f"CREATE TYPE track_number AS ENUM (SELECT * FROM ({owners}) ORDER BY 1)")
        ids = ", ".join(f"{column}::{number} AS {column}" for column, number in _NUMBERED[name].items())
        stored = text.partition(f"CREATE VIEW {name} AS\n")[2].rstrip().rstrip(";")
        return f"CREATE TEMP TABLE {name} AS SELECT * REPLACE ({ids}) FROM (\n{stored}\n)"

    def _comment(self, name: str) -> None:
        """Comment a view and its columns with the texts of the contract."""
        self._commented.add(name)
        if name not in FILE_TABLES:
            return
        table = tables.load(name)
        comments = [f"COMMENT ON VIEW {name} IS {quoted(table.doc)}"]
        for column in (*table.columns, *table.derived):
            meaning = column.doc + (f" [{column.unit}]" if column.unit else "")
            comments.append(f"COMMENT ON COLUMN {name}.{column.name} IS {quoted(meaning)}")
        self.connection.execute("; ".join(comments))

    def _relation(self, table: str) -> str:
        """Return SQL for the files of a table: a scan, or no rows of the right types without files."""
        listed = table_files(self.files, self.snapshot, table)
        if self.chosen is not None and table in ("tracks", "lights"):  # of shared maps, scenarios have no address
            wanted = set(pc.unique(self.chosen[f"{table}_file"]).to_pylist())
            listed = [name for name in listed if name in wanted]
        names = list(filterfalse(self.without.__contains__, listed))
        is_current = tables.load(table).tag in self.schemas
        if table == "metadata" and not (is_current or self.without):
            from scenarionet_data.storage.read.older_lakes import count_rows  # here: most lakes are newer

            count_rows(self.files, self.snapshot)
        if not names:
            columns = [f"NULL::{_sql_type(c)} AS {c.name}" for c in tables.load(table).columns]
            folders = ["NULL::VARCHAR AS " + name for name in _HIVE_COLUMNS.get(table, ())]
            return f"(SELECT {', '.join(columns + folders)} WHERE false)"
        self.scanned |= dict.fromkeys(names)
        paths = self.files.scans(names)
        self.connection.execute(f"SET VARIABLE {table}_files = $paths", {"paths": paths})
        scan = scan_files(table, f"getvariable('{table}_files')", is_current=is_current)
        if self.chosen is None or table not in _KEYS:
            return scan
        return f"(SELECT * FROM {scan} SEMI JOIN chosen USING ({_KEYS[table]}))"


def scan_files(table: str, files: str, *, is_current: bool) -> str:
    """Return SQL for the rows of files of any readable schema version: columns that older files lack are null.

    Args:
        table: The table.
        files: SQL for the list of files.
        is_current: All files have the current schema version: the columns need not be listed, which would double the
            time of a small query.
    """
    folders = _HIVE_COLUMNS.get(table, ())
    if is_current or not tables.load(table).added:
        if not folders:
            return f"read_parquet({files}, hive_partitioning = false)"
        return f"read_parquet({files}, hive_partitioning = true, hive_types_autocast = false)"
    # With the columns given, DuckDB need not open every file first, as union_by_name does (800 files: 0.3 s).
    columns = ", ".join(
        f"'{column.name}': {{name: '{column.name}', type: '{_sql_type(column)}', default_value: NULL}}"
        for column in tables.load(table).columns
    )
    schema = f"hive_partitioning = false, schema = MAP {{{columns}}}"
    if not folders:
        return f"read_parquet({files}, {schema})"
    # DuckDB skips files by conditions on these columns, as it does for those of hive_partitioning.
    values = ", ".join(f"regexp_extract(filename, '/{name}=([^/]*)/', 1) AS {name}" for name in folders)
    return f"(SELECT * EXCLUDE (filename), {values} FROM read_parquet({files}, {schema}, filename = true))"


def dependencies(sql: str) -> str:
    """Return the SQL of all views and macros that a query depends on."""
    defined, found, names = _definitions(), dict[str, str](), sorted(words(sql))
    while names:
        name = names.pop()
        if name in defined and name not in found:
            found[name] = defined[name].read_text("utf-8")
            needs = _NEEDS.search(found[name])
            names += needs[1].split(", ") if needs else []
    return "\n".join(found[name] for name in sorted(found))


@cache
def _definitions() -> dict[str, Path]:
    """Return the file of each view and macro by name."""
    return {path.stem: path for folder in ("macros", "views") for path in (SQL / folder).glob("*.sql")}


_SQL_TYPES = {
    "binary": "BLOB",
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
