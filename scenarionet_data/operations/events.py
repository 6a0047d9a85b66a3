"""Event mining: events inside scenarios, one definition per file in ``sql/events``, with parameters.

Each file selects the occurrences of one event: scenario_id, track_id (the acting object), other_id (the other object,
or null), first_timestep, last_timestep and value, whose meaning and unit the head of the file states.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.named_sql import EVENTS

if TYPE_CHECKING:
    import polars as pl


def mine(
    view: LakeView,
    event: str,
    parameters: Mapping[str, Any] | None = None,
    database: DatabaseRecord | str | None = None,
) -> pl.DataFrame:
    """Find all occurrences of an event; see :meth:`Lake.mine <scenarionet_data.Lake.mine>`."""
    found = EVENTS.load(event)
    bound = found.bind(parameters or {})
    if database is not None:
        view = view.restrict_to(database)
    query = f"SELECT * FROM (\n{found.text}\n) ORDER BY scenario_id, first_timestep, track_id, other_id"
    return view.sql(query, bound)
