"""Events: what happens inside scenarios, one definition a file in ``sql/events``, with parameters.

Each file selects its hits: scenario_id, track_id (who does it), other_id (with or to whom; null for nobody),
first_timestep, last_timestep and value, whose meaning and unit its head names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from scenarionet_data.catalog import named_sql
from scenarionet_data.catalog.named_sql import NamedSql
from scenarionet_data.errors import UnknownEvent

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.catalog.database import Database
    from scenarionet_data.catalog.lake import Lake

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


def mine(
    lake: Lake, name: str, words: Mapping[str, str] | None = None, *, database: Database | str | None = None
) -> pl.DataFrame:
    """Every hit of an event, in order of scenario and time.

    Args:
        lake: The lake.
        name: The event.
        words: Values for its parameters, as typed; the rest keep their defaults.
        database: Look at its members only.

    Raises:
        UnknownEvent: No such event.
        BadParameter: No such parameter, or no such value.
    """
    event = load(name)
    bound = event.bind(words or {})
    asked = lake if database is None else lake.only(database)
    query = f"SELECT * FROM (\n{event.text}\n) ORDER BY scenario_id, first_timestep, track_id, other_id"
    return asked.sql(query, bound)
