"""The contract in ``schemas/*.toml`` as objects: Arrow schemas, Parquet writer options, SQL, documentation.

A column is declared once, in TOML, with its type, nullability, unit and meaning; everything here derives from it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import SchemaMismatch
from scenarionet_data.schema.package_data import SCHEMAS

CONTENT = ("metadata", "tracks", "lights", "maps", "quarantine")
TABLES = (*CONTENT, "shards", "members", "results", "rollouts", "observations")

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
"""Columns of the metadata table that a scenario is read back from, beside the rows of the other tables."""

_BULKY = 4096  # bytes

_SCALARS = {
    "bool": pa.bool_(),
    "int8": pa.int8(),
    "int32": pa.int32(),
    "int64": pa.int64(),
    "uint64": pa.uint64(),
    "float32": pa.float32(),
    "float64": pa.float64(),
    "string": pa.string(),
    "json": pa.string(),
    "dictionary": pa.dictionary(pa.int32(), pa.string()),
}


@dataclass(frozen=True)
class Column:
    """One column of the contract.

    Attributes:
        name: Its name.
        type: Its type as the TOML spells it: a scalar, or ``list<scalar>``.
        doc: What it means.
        unit: SI unit, empty for what has none.
        nullable: Whether null is allowed.
        statistics: Whether files carry minimum and maximum, so that readers can skip row groups.
        sql: Expression that computes it from the other columns; such a column is in the view, not in the files.
    """

    name: str
    type: str
    doc: str
    unit: str = ""
    nullable: bool = False
    statistics: bool = False
    sql: str | None = None

    @property
    def is_list(self) -> bool:
        """Whether each row holds a list."""
        return self.type.startswith("list<")

    @property
    def element(self) -> str:
        """The scalar type: the list's element, or the type itself."""
        return self.type.removeprefix("list<").removesuffix(">")

    @property
    def arrow_type(self) -> pa.DataType:
        """Its Arrow type."""
        scalar = _SCALARS[self.element]
        return pa.list_(pa.field("element", scalar, nullable=False)) if self.is_list else scalar

    @property
    def path(self) -> str:
        """Its leaf in a Parquet file."""
        return f"{self.name}.list.element" if self.is_list else self.name


@dataclass(frozen=True)
class Table:
    """One table of the contract.

    Attributes:
        name: metadata, tracks, lights or maps.
        version: Raised when a column changes; files say under which version they were written.
        doc: What a row is.
        columns: Columns of the files, in order.
        derived: Columns that the view computes.
    """

    name: str
    version: int
    doc: str
    columns: tuple[Column, ...]
    derived: tuple[Column, ...]

    @property
    def schema(self) -> pa.Schema:
        """Arrow schema, as files carry it."""
        return _schema(self)

    def column(self, name: str) -> Column:
        """The column of that name, stored or derived."""
        return next(column for column in (*self.columns, *self.derived) if column.name == name)

    def writer_options(self, sample: pa.Table | pa.RecordBatch | None = None) -> dict[str, Any]:
        """Options of ``pyarrow.parquet.ParquetWriter`` (measured: see docs/explanation/architecture.md).

        Args:
            sample: The first rows of the file, which tell where the bytes are; everywhere when there are none.
        """
        numbers = [column for column in self.columns if column.is_list and _is_number(column.element)]
        packed = numbers + [column for column in self.columns if column.element == "json"]
        # Setting up zstd costs 30 us a column to write and to read: it is spent where the bytes are.
        bulky = [c.path for c in packed if sample is None or sample.column(c.name).nbytes >= _BULKY]
        return {
            "compression": {c.path: "zstd" if c.path in bulky else "lz4" for c in self.columns},
            "compression_level": dict.fromkeys(bulky, 2) or None,
            # Ids are all different: a dictionary of them costs time and saves nothing.
            "use_dictionary": [c.path for c in self.columns if c.element == "dictionary"],
            # Of integers only some readers understand split bytes.
            "column_encoding": {
                c.path: "BYTE_STREAM_SPLIT" if c.element.startswith("float") else "PLAIN" for c in numbers
            },
            "write_statistics": [column.path for column in self.columns if column.statistics],
            "version": "2.6",
            # One page to a column of a row group: the loader's own loops read it, and queries are as fast.
            "data_page_size": 2**26,
            # Arrow's own copy of the schema is half of a small file's footer, and Parquet's says the same.
            "store_schema": False,
        }

    def writer(
        self, path: Path, footer: Mapping[str, str], sample: pa.Table | pa.RecordBatch | None = None
    ) -> pq.ParquetWriter:
        """A writer of this table's files.

        Args:
            path: Where to write.
            footer: Further words for the file's footer.
            sample: The first rows that will be written, see :meth:`writer_options`.
        """
        writer = pq.ParquetWriter(path, self.schema, **self.writer_options(sample))
        writer.add_key_value_metadata({"scenarionet.schema": self.tag, **footer})
        return writer

    def check_version(self, footer: dict[bytes, bytes] | None, path: str) -> None:
        """Refuse a file of another version of this table.

        Raises:
            SchemaMismatch: Naming the file, what was found and what to do.
        """
        found = (footer or {}).get(b"scenarionet.schema", b"none").decode()
        if found != self.tag:
            raise SchemaMismatch(
                f"{path}: written under schema {found}, this version reads {self.tag}; "
                "convert the recordings again with --replace, or use the version that wrote the lake"
            )

    def conform(self, rows: pa.Table) -> pa.Table:
        """Rows cast to this table's schema; nullable columns they lack are filled with null.

        Raises:
            SchemaMismatch: A required column is missing.
        """
        schema = self.schema
        columns = []
        for field in schema:
            if field.name in rows.column_names:
                columns.append(rows[field.name].cast(field.type))
            elif field.nullable:
                columns.append(pa.chunked_array([pa.nulls(rows.num_rows, field.type)]))
            else:
                raise SchemaMismatch(f"the table {self.name} lacks the required column {field.name}")
        return pa.Table.from_arrays(columns, schema=schema)

    @property
    def tag(self) -> str:
        """Name and version, as files carry it."""
        return f"{self.name}/{self.version}"


@cache
def load(name: str) -> Table:
    """The table of that name, read from ``schemas/<name>.toml``."""
    declared = tomllib.loads((SCHEMAS / f"{name}.toml").read_text("utf-8"))
    columns = tuple(Column(name=key, **fields) for key, fields in declared["columns"].items())
    derived = tuple(Column(name=key, **fields) for key, fields in declared.get("derived", {}).items())
    return Table(declared["table"], declared["version"], declared["doc"], columns, derived)


@cache
def content_tag() -> str:
    """Versions of every table that a shard's files belong to, as its record carries them."""
    return " ".join(load(name).tag for name in sorted(CONTENT))


@cache
def _schema(table: Table) -> pa.Schema:
    # Without the columns' words: every file would carry them, 10 kB in one of 30.
    fields = [pa.field(column.name, column.arrow_type, nullable=column.nullable) for column in table.columns]
    return pa.schema(fields)


def _is_number(element: str) -> bool:
    return element not in ("string", "dictionary", "json")
