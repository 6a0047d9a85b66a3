"""Events: what happens inside scenarios, one definition a file in ``sql/events``, with parameters.

Each file selects its hits: scenario_id, track_id (who does it), other_id (with or to whom; null for nobody),
first_timestep, last_timestep and value, whose meaning and unit its head names.
"""

from __future__ import annotations

from typing import Any

from scenarionet_data.catalog import named_sql
from scenarionet_data.catalog.named_sql import NamedSql
from scenarionet_data.errors import UnknownEvent

_FOLDER = "events"


def names() -> list[str]:
    """Events there are, sorted."""
    return named_sql.names(_FOLDER)


def load(name: str) -> NamedSql:
    """An event by name.

    Raises:
        UnknownEvent: The message lists the nearest names.
    """
    return named_sql.load(_FOLDER, name, UnknownEvent)


def parse(text: str) -> tuple[NamedSql, dict[str, Any]]:
    """An event with its parameters from the command line's ``name:key=value,key=value``.

    Raises:
        UnknownEvent: No such event.
        BadParameter: No such parameter, or no such value.

    Example:
        >>> parse("cut_in:max_gap=20")[1]["max_gap"]
        20.0
    """
    return named_sql.parse(_FOLDER, text, UnknownEvent)
