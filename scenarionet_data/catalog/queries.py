"""Named questions: one SELECT a file in ``sql/analytics``, with parameters."""

from __future__ import annotations

from scenarionet_data.catalog import named_sql
from scenarionet_data.catalog.named_sql import NamedSql
from scenarionet_data.errors import UnknownQuery

_FOLDER = "analytics"


def names() -> list[str]:
    """Questions there are, sorted."""
    return named_sql.names(_FOLDER)


def load(name: str) -> NamedSql:
    """A question by name.

    Raises:
        UnknownQuery: The message lists the nearest names.
    """
    return named_sql.load(_FOLDER, name, UnknownQuery)
