"""The part of the handle ``Lake`` that adds and removes user columns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarionet_data.databases.user_columns import UserColumn
from scenarionet_data.operations import tagging
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.named_sql import Conditions

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa


class TaggableLake(LakeView):
    """A view of a lake with methods for user columns; a base class of :class:`~scenarionet_data.Lake`."""

    def tag(
        self,
        name: str,
        rows: pa.Table | pl.DataFrame | Mapping[str, Any],
        *,
        source: str = "python",
        replace: bool = False,
    ) -> UserColumn:
        """Add a user column to ``metadata``; call :meth:`refresh` to query it.

        Args:
            name: Name of the column: a lower-case word that is not a column yet.
            rows: A table with scenario_id and one more column, or a value by scenario id; null for other scenarios.
            source: Origin of the values, for the record.
            replace: Add a version if the user column exists.

        Raises:
            BadParameter: The name is taken or invalid, or the table has other columns.
            ScenarioNotFound: The lake does not have one of the ids.
            UserColumnExists: The user column exists and ``replace`` is False.
        """
        return tagging.tag(self, name, rows, source=source, replace=replace)

    def tag_by_sql(self, name: str, query: str, *, replace: bool = False) -> UserColumn:
        """Add a user column from a SELECT of scenario_id and one more column; see :meth:`tag`."""
        return tagging.tag_by_sql(self, name, query, replace=replace)

    def tag_where(self, name: str, where: str, *, replace: bool = False) -> UserColumn:
        """Add a label: whether a condition over the columns of ``metadata`` holds; see :meth:`tag`."""
        return tagging.tag_where(self, name, where, replace=replace)

    def tag_event(self, name: str, event: Conditions, *, replace: bool = False) -> UserColumn:
        """Add a count: how often an event occurs, as ``"cut_in:max_gap=20"`` or ``{"cut_in": {"max_gap": 20}}``."""
        return tagging.tag_event(self, name, event, replace=replace)

    def tag_from_file(
        self, name: str, path: str | Path, column: str | None = None, *, replace: bool = False
    ) -> UserColumn:
        """Add a user column from a CSV or Parquet file with scenario_id; see :meth:`tag`.

        Args:
            name: Name of the column in the lake.
            path: The file.
            column: Name of the column in the file; needed if it has several besides scenario_id.
            replace: Add a version if the user column exists.
        """
        return tagging.tag_from_file(self, name, path, column, replace=replace)

    def untag(self, name: str, *, force: bool = False) -> None:
        """Remove a user column with all its versions, or one version ``name@version``.

        Args:
            name: The user column.
            force: Remove it even if databases depend on it; those stay readable, but cannot be rebuilt.

        Raises:
            UserColumnNotFound: The message lists the existing ones.
            UserColumnInUse: Databases depend on it and ``force`` is False.
        """
        tagging.untag(self, name, force=force)
