"""Mining events: what happens inside scenarios, one definition a file in ``sql/events``, with parameters.

Each file selects its hits: scenario_id, track_id (who does it), other_id (with or to whom; null for nobody),
first_timestep, last_timestep and value, whose meaning and unit its head names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenarionet_data.query.named_sql import EVENTS

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.databases.record import Database
    from scenarionet_data.lake.lake import Lake


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
    event = EVENTS.load(name)
    bound = event.bind(words or {})
    asked = lake if database is None else lake.only(database)
    query = f"SELECT * FROM (\n{event.text}\n) ORDER BY scenario_id, first_timestep, track_id, other_id"
    return asked.sql(query, bound)
