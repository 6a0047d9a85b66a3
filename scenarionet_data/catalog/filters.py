"""Named filters: one condition over the view ``metadata`` a file in ``sql/filters``, with parameters."""

from __future__ import annotations

from typing import Any

from scenarionet_data.catalog import named_sql
from scenarionet_data.catalog.named_sql import NamedSql
from scenarionet_data.errors import UnknownFilter

_FOLDER = "filters"


def names() -> list[str]:
    """Filters there are, sorted."""
    return named_sql.names(_FOLDER)


def load(name: str) -> NamedSql:
    """A filter by name.

    Raises:
        UnknownFilter: The message lists the nearest names.
    """
    return named_sql.load(_FOLDER, name, UnknownFilter)


def parse(text: str) -> tuple[NamedSql, dict[str, Any]]:
    """A filter with its parameters from the command line's ``name:key=value,key=value``.

    Raises:
        UnknownFilter: No such filter.
        BadParameter: No such parameter, or no such value.

    Example:
        >>> parse("ego_distance:min=25")[1]["min"]
        25.0
    """
    return named_sql.parse(_FOLDER, text, UnknownFilter)
