"""Table schemas declared in ``schemas/*.toml``: Arrow schemas, Parquet writer options, versions, documentation.

A column is declared once, in TOML, with its type, nullability, unit and meaning; everything else derives from it.

To add a nullable column, raise the table's ``version`` and declare the column with ``since`` set to that version: files
of older versions are still read, with nulls. For any other change set the table's ``oldest`` to the new version, too.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import SchemaMismatch
from scenarionet_data.optional_imports import defer, leave_pandas_out
from scenarionet_data.schema.package_data import SCHEMAS

leave_pandas_out()  # here, as all tables have a schema
defer("pyarrow.compute")  # 300 functions, in a tenth of the time of a short command

CONTENT = ("metadata", "tracks", "lights", "maps", "quarantine", "defects")
TABLES = (
    *CONTENT,
    "shards",
    "members",
    "member_bits",
    "id_order",
    "results",
    "rollouts",
    "observations",
    "frames",
    "training",
    "moments",
    "predictions",
    "scores",
)

DESCRIPTION_COLUMNS = (
    "scenario_id",
    "dataset",
    "version",
    "split",
    "source_scenario_id",
    "source_file",
    "source_log",
    "city",
    "date",
    "licence",
    "origin_x",
    "origin_y",
    "origin_z",
    "crs",
    "has_z",
    "num_timesteps",
    "dt",
    "timestamps",
    "current_timestep",
    "ego_id",
    "objects_of_interest",
    "tracks_to_predict",
    "tracks_to_predict_difficulty",
    "map_id",
    "map_crop",
    "extras",
)
"""Columns of the metadata table that decoding a scenario needs, besides the rows of the other tables."""

_BULKY = 4096  # bytes

LOADED = ("tracks", "lights", "maps")
"""Tables that scenarios are loaded from, one row group at a time."""

SEALED = {"scenarionet.sealed": "2"}
"""Entry in the footer of every file that gets a seal, see ``storage/integrity``."""

_REMEDY = "convert the recordings again with replace=True, or use the version of this software that wrote the lake"

_SCALARS = {
    "bool": pa.bool_(),
    "int8": pa.int8(),
    "int32": pa.int32(),
    "int64": pa.int64(),
    "uint64": pa.uint64(),
    "binary": pa.binary(),
    "float32": pa.float32(),
    "float64": pa.float64(),
    "string": pa.string(),
    "json": pa.string(),
    "dictionary": pa.dictionary(pa.int32(), pa.string()),
}


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: Its name.
        type: Type as spelled in TOML: a scalar, or ``list<scalar>``.
        doc: Meaning.
        unit: SI unit, or an empty string.
        nullable: Whether null is allowed.
        statistics: Whether files store minimum and maximum, so that readers can skip row groups.
        sql: Expression that computes it from the other columns; such a column is in the view, not in the files.
        since: Version of the table that added it.
        owner: Whose definition a metric is, such as ``nuPlan``; empty for a column that is none.
        better: ``higher`` or ``lower`` for a metric that tells better from worse, otherwise empty.
    """

    name: str
    type: str
    doc: str
    unit: str = ""
    nullable: bool = False
    statistics: bool = False
    sql: str | None = None
    since: int = 1
    owner: str = ""
    better: str = ""

    @cached_property
    def is_list(self) -> bool:
        """Whether each row holds a list."""
        return self.type.startswith("list<")

    @cached_property
    def element(self) -> str:
        """Scalar type: of the list's elements, or the type itself."""
        return self.type.removeprefix("list<").removesuffix(">")

    @cached_property
    def arrow_type(self) -> pa.DataType:
        """Arrow type."""
        scalar = _SCALARS[self.element]
        return pa.list_(pa.field("element", scalar, nullable=False)) if self.is_list else scalar

    @cached_property
    def path(self) -> str:
        """Path of the leaf column in a Parquet file."""
        return f"{self.name}.list.element" if self.is_list else self.name


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        name: One of TABLES.
        version: Raised when a column changes; files state the version under which they were written.
        doc: Meaning of a row.
        columns: Columns of the files, in order.
        derived: Columns that the view computes.
        oldest: Oldest version whose files can be read.
    """

    name: str
    version: int
    doc: str
    columns: tuple[Column, ...]
    derived: tuple[Column, ...]
    oldest: int = 1

    @cached_property
    def schema(self) -> pa.Schema:
        """Arrow schema of the files, without the columns' descriptions (10 kB in files of 30 kB)."""
        return pa.schema(
            [pa.field(column.name, column.arrow_type, nullable=column.nullable) for column in self.columns]
        )

    @cached_property
    def added(self) -> tuple[Column, ...]:
        """Columns that files of the oldest readable version lack."""
        return tuple(column for column in self.columns if column.since > self.oldest)

    @cached_property
    def derived_sql(self) -> str:
        """SQL of the derived columns, each after a comma."""
        return "".join(f", {column.sql} AS {column.name}" for column in self.derived)

    def column(self, name: str) -> Column:
        """Find a column, stored or derived."""
        return next(column for column in (*self.columns, *self.derived) if column.name == name)

    def writer_options(
        self, sample: pa.Table | pa.RecordBatch | None = None, zstd_level: int | None = None
    ) -> dict[str, Any]:
        """Options of ``pyarrow.parquet.ParquetWriter`` (measured: see docs/explanation/architecture.md).

        Args:
            sample: The first rows of the file, which show the columns with most bytes; all list columns without it.
            zstd_level: Compress all columns with zstd of this level, for archives.
        """
        compression, levels, encodings = dict[str, str](), dict[str, int](), dict[str, str]()
        dictionaries, statistics = list[str](), list[str]()
        for column in self.columns:
            is_bulky = column.element == "json" and self.name not in LOADED
            is_bulky = is_bulky and (sample is None or sample.column(column.name).nbytes >= _BULKY)
            # The kernels of the loader know dictionaries in LZ4 only.
            is_zstd = is_bulky or (zstd_level is not None and column.element != "dictionary")
            compression[column.path] = "zstd" if is_zstd else "lz4"
            if is_zstd:
                levels[column.path] = zstd_level or 2
            if column.element == "dictionary":
                dictionaries.append(column.path)  # ids are unique: a dictionary would save nothing
            elif column.is_list and column.element not in ("string", "json"):
                # Not all readers support BYTE_STREAM_SPLIT for integers.
                encodings[column.path] = "BYTE_STREAM_SPLIT" if column.element.startswith("float") else "PLAIN"
            if column.statistics:
                statistics.append(column.path)
        return {
            "compression": compression,
            "compression_level": levels or None,
            "use_dictionary": dictionaries,
            "column_encoding": encodings,
            "write_statistics": statistics,
            "version": "2.6",
            # One page per column chunk: the kernels of the loader require it, and queries are as fast.
            "data_page_size": 2**26,
            "write_page_checksum": True,  # for other readers
            # Arrow's copy of the schema is half of a small file's footer and redundant.
            "store_schema": False,
        }

    @cached_property
    def _options(self) -> dict[str, Any]:
        return self.writer_options()

    def writer(
        self,
        path: Path,
        footer: Mapping[str, str],
        sample: pa.Table | pa.RecordBatch | None = None,
        zstd_level: int | None = None,
    ) -> pq.ParquetWriter:
        """Open a file of this table for writing.

        Args:
            path: The file.
            footer: Further entries for the file's footer.
            sample: The first rows that will be written, see :meth:`writer_options`.
            zstd_level: See :meth:`writer_options`.
        """
        options = self.writer_options(sample, zstd_level) if sample is not None or zstd_level else self._options
        writer = pq.ParquetWriter(path, self.schema, **options)
        writer.add_key_value_metadata({"scenarionet.schema": self.tag, **footer, **SEALED})
        return writer

    def reads(self, tag: str) -> bool:
        """Whether files of a version (``tracks/1``) can be read."""
        name, _, version = tag.partition("/")
        return name == self.name and version.isdecimal() and self.oldest <= int(version) <= self.version

    def check_version(self, footer: Mapping[bytes, bytes] | None, path: str) -> None:
        """Raise unless a file was written under a readable version of this table.

        Raises:
            SchemaMismatch: The message names the file, both versions and the remedy.
        """
        found = (footer or {}).get(b"scenarionet.schema", b"none").decode(errors="replace")
        if found != self.tag and not self.reads(found):
            raise SchemaMismatch(f"{path}: written under schema {found}, this version reads {self.tag}; {_REMEDY}")

    def conform(self, rows: pa.Table, names: Sequence[str] | None = None) -> pa.Table:
        """Cast rows to this table's schema; nullable columns that they lack become null.

        Args:
            rows: Rows of a file of any readable version.
            names: Columns of the result; all of the table by default.

        Raises:
            SchemaMismatch: A required column is missing.
        """
        schema = self.schema if names is None else pa.schema(map(self.schema.field, names))
        present, columns = set(rows.column_names), []
        for field in schema:
            if field.name in present:
                column = rows[field.name]
                columns.append(column if column.type == field.type else column.cast(field.type))
            elif field.nullable:
                columns.append(pa.chunked_array([pa.nulls(rows.num_rows, field.type)]))
            else:
                raise SchemaMismatch(f"rows of the table {self.name} lack the required column {field.name}; {_REMEDY}")
        return pa.Table.from_arrays(columns, schema=schema)

    @cached_property
    def tag(self) -> str:
        """Name and version as stored in files."""
        return f"{self.name}/{self.version}"


@cache
def load(name: str) -> Table:
    """Read the declaration of a table from ``schemas/<name>.toml``."""
    declared = tomllib.loads((SCHEMAS / f"{name}.toml").read_text("utf-8"))
    columns = tuple(Column(name=key, **fields) for key, fields in declared["columns"].items())
    derived = tuple(Column(name=key, **fields) for key, fields in declared.get("derived", {}).items())
    return Table(declared["table"], declared["version"], declared["doc"], columns, derived, declared.get("oldest", 1))


@cache
def content_tag() -> str:
    """Versions of all tables that a shard's files belong to, as stored in its record."""
    return " ".join(load(name).tag for name in sorted(CONTENT))


def reads_content(tag: str) -> bool:
    """Whether files of a shard with these versions (see :func:`content_tag`) can be read."""
    return all(part.partition("/")[0] in CONTENT and load(part.partition("/")[0]).reads(part) for part in tag.split())
