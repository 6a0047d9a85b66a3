"""Parquet decoder for row groups as this package writes them; :class:`ColumnReader` is its only entry.

Depends on nothing of this package but ``arrays``, so that it can be replaced by Arrow or used elsewhere.
"""

from scenarionet_data.storage.read.parquet.column_reader import COMPILE_AFTER, ColumnReader
from scenarionet_data.storage.read.parquet.footer import Footer, RowGroup, UnreadableFile

__all__ = ["COMPILE_AFTER", "ColumnReader", "Footer", "RowGroup", "UnreadableFile"]
