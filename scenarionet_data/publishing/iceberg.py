"""Apache Iceberg tables (format version 2, https://iceberg.apache.org/spec) in an SQLite catalog, by PyIceberg."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import needing

NAMESPACE = "lake"


def write_iceberg(folder: Path, files: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Write ``catalog.sqlite`` and the metadata of the tables; return where each table's metadata are.

    Args:
        folder: The warehouse, an existing folder.
        files: Absolute paths of the Parquet files of each table; they are referenced where they are.
    """
    with needing("publishing as Iceberg needs PyIceberg", "iceberg"):
        from pyiceberg.catalog.sql import SqlCatalog
    catalog = SqlCatalog(NAMESPACE, uri=f"sqlite:///{folder}/catalog.sqlite", warehouse=folder.as_uri())
    logger = logging.getLogger("pyiceberg.io.pyarrow")  # it warns of every column without statistics
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        catalog.create_namespace(NAMESPACE)
        locations = {}
        for name, listed in files.items():
            schemas = [pq.read_schema(file).remove_metadata() for file in listed]
            columns = pa.unify_schemas(schemas, promote_options="permissive")
            nullable = pa.schema([field.with_nullable(True) for field in columns])  # older lakes lack some
            table = catalog.create_table(f"{NAMESPACE}.{name}", schema=nullable)
            table.add_files(list(listed))
            locations[name] = table.metadata_location
    finally:
        logger.setLevel(level)
        catalog.close()
    return locations
