"""Find the disturbances of a lake: its tables of occurrences and of exposure, mined in batches of scenarios."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import pyarrow as pa

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import EmptyResult
from scenarionet_data.execution.progress import Progress
from scenarionet_data.operations.mining import cut
from scenarionet_data.operations.moments import inlined, relation
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.query.named_sql import CATALOGUE, DISTURBANCES

PARAMETERS = ("ego_speed", "speed", "gap", "lateral_speed", "rate", "revealed_gap", "revealed_speed")
_SCHEMA = pa.schema(
    [
        ("definition", pa.string()),
        ("scenario_id", pa.string()),
        ("track_id", pa.string()),
        ("other_id", pa.string()),
        ("first_timestep", pa.int32()),
        ("last_timestep", pa.int32()),
        ("road", pa.string()),
        ("ego_changes_lane", pa.bool_()),
        *((name, pa.float64()) for name in PARAMETERS),
        ("cell", pa.string()),
    ]
)


@dataclass(frozen=True)
class Catalogue:
    """The disturbances of some scenarios.

    Attributes:
        disturbances: One row per occurrence: definition, scenario, the vehicle that disturbs (``track_id``), the ego
            (``other_id``), window, road, whether the ego changes lanes, parameters [m], [m/s], [m/s^2], and their cell.
        exposure: One row per scenario and road: dataset, place, ``meters`` and ``seconds`` of the ego.
        left_out: What was not counted, by reason.
    """

    disturbances: pa.Table
    exposure: pa.Table
    left_out: dict[str, int]


def definition_sql(name: str) -> str:
    """Return the SELECT of a disturbance with the values of its parameters."""
    return inlined(DISTURBANCES.load(name), {})


def gather_catalogue(
    lake: LakeLike, database: DatabaseRecord | str | None = None, on_progress: Progress | None = None
) -> Catalogue:
    """Find all disturbances of the egos of a lake; scenarios that were made of others are left out.

    Args:
        lake: The lake.
        database: Only its members.
        on_progress: Called after each batch with the number of scenarios.

    Raises:
        EmptyResult: There are no scenarios.
    """
    view = open_view(lake)
    if database is not None:
        view = view.restrict_to(database)
    made = "('moment', 'variation')"
    rows = view.arrow(
        f"SELECT scenario_id, num_states FROM metadata_rows WHERE dataset NOT IN {made} ORDER BY scenario_id"
    )
    if not rows.num_rows:
        raise EmptyResult(f"{view.root}: no recorded or generated scenarios to search for disturbances")
    found, exposure, left_out, done = list[pa.Table](), list[pa.Table](), Counter[str](), 0
    for part in cut(rows["num_states"].to_numpy()):
        ids = rows["scenario_id"][part.start : part.stop].to_pylist()
        batch = view.restrict_to(ids).keeping
        found += _disturbances(batch)
        exposure.append(batch.arrow(CATALOGUE.load("exposure").text))
        for row in batch.arrow(CATALOGUE.load("left_out").text).to_pylist():
            left_out[row["reason"]] += row["number"]
        batch.engine.close()
        done += len(ids)
        if on_progress:
            on_progress(done, rows.num_rows, 0)
    order = [(name, "ascending") for name in ("definition", "scenario_id", "first_timestep", "track_id")]
    return Catalogue(pa.concat_tables(found).sort_by(order), pa.concat_tables(exposure), dict(sorted(left_out.items())))


def _disturbances(view: LakeView) -> Iterator[pa.Table]:
    """Yield the disturbances of each definition."""
    changing = view.arrow(
        f"SELECT scenario_id, timestep FROM (\n{relation('changing_lanes').sql}\n) "
        "JOIN (SELECT scenario_id, ego_id AS track_id FROM metadata_rows) USING (scenario_id, track_id)"
    )
    rounded = ", ".join(f"round({each}, 6) AS {each}" for each in PARAMETERS)
    text = CATALOGUE.load("disturbances").text.replace("{parameters}", ", ".join(PARAMETERS))
    for name in DISTURBANCES.names():
        found = view.arrow(definition_sql(name))
        for missing in [each for each in PARAMETERS if each not in found.column_names]:
            found = found.append_column(missing, pa.nulls(found.num_rows, pa.float64()))
        given = {"found": found, "changing": changing}
        rows = view.arrow(text.replace("{rounded}", rounded), {"definition": name}, tables=given)
        yield rows.select(_SCHEMA.names).cast(_SCHEMA)
