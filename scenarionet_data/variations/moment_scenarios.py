"""Databases of kept moments: each moment is cut out as a scenario of its own, with its window, roles and ego.

The scenarios are version ``NAME`` of the dataset ``moment``, where NAME is that of the kept moments. They copy the
tracks and the map of their window, so that whatever works with scenarios works with moments; the same moment is cut
once.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.conversion.committer import ConversionReport
from scenarionet_data.databases import record as records
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, EmptyResult
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.ingest.shard import RawItem, Shard, bucket
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.operations.filter import IN_ORDER, ranked
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.query.statements import check_expression, explaining
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.variations.moment_windows import ROLES, MomentWindow, check_kept, cut_out, seen_from
from scenarionet_data.variations.writing import OfParents, ParentOptions, write_shards

DATASET = "moment"
"""The dataset of all moments in a lake; its versions are the names under which they are kept."""

Ego = Literal["ego", "actor", "other"]
"""Who drives in a scenario of a moment: the recording's ego, or the road user of a role."""


@dataclass(frozen=True)
class MomentChoice:
    """Which of the kept moments become scenarios, and how.

    Attributes:
        where: SQL condition over the columns of ``moments`` and ``metadata``.
        order_by: SQL expression over them that orders the moments; by default scenario and time do.
        limit: Keep the first so many only.
        ego: Who is the ego.
        margin: Time that is kept before and after each moment [s].
        database: Only moments of its members.
    """

    where: str = "true"
    order_by: str | None = None
    limit: int | None = None
    ego: Ego = "ego"
    margin: float = 2.0
    database: DatabaseRecord | str | None = None

    def __post_init__(self) -> None:
        check_expression(self.where)
        if self.ego not in get_args(Ego):
            raise BadParameter(f"ego={self.ego!r}: wanted one of {', '.join(get_args(Ego))}")
        if self.limit is not None and not is_count(self.limit, 1):
            raise BadParameter(f"limit={self.limit!r}; expected a whole number of 1 or more")
        if not (isinstance(self.margin, int | float) and self.margin >= 0):
            raise BadParameter(f"margin={self.margin!r}: wanted seconds, 0 or more")


@dataclass(frozen=True)
class CutMoments:
    """What was made of kept moments.

    Attributes:
        database: Its members are the moments, in order.
        wanted: Number of moments that were chosen: more than the database has if some could not be cut out.
        report: What was added to the lake now.
    """

    database: DatabaseRecord
    wanted: int
    report: ConversionReport


class MomentScenarios(OfParents):
    """Scenarios of moments; :func:`cut_moments` lists its shards."""

    name: ClassVar[str] = DATASET
    version: ClassVar[str] = "1"
    release: ClassVar[str] = "moments"
    licence: ClassVar[str] = "that of the recording, see the column licence"
    raw: ClassVar[str] = "kept moments of the lake"
    Options = ParentOptions

    def scenario(self, shard: Shard, record: tuple[ScenarioDescription, RawItem]) -> ScenarioDescription:
        """Cut the moment out of its recording."""
        parent, item = record
        values: dict[str, Any] = json.loads(item.fingerprint)
        window = MomentWindow(**values["moment"])
        seen = parent if values["ego"] not in ROLES else seen_from(parent, window, values["ego"])
        return dataclasses.replace(
            cut_out(seen, window, values["margin"]).with_own_map(),
            id=values["id"],
            dataset=DATASET,
            version=shard.version,
            extras={**parent.extras, "parent": parent.id, **values},
        )


def cut_moments(
    lake: LakeLike,
    moments: str,
    choice: MomentChoice | None = None,
    *,
    name: str,
    replace: bool = False,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> CutMoments:
    """Save kept moments as a database of scenarios, one for each moment.

    It is now when the moment begins. ``extras`` has ``parent`` and ``moment``. A moment whose role nobody has, or whose
    ego is not there, goes to quarantine with the reason, and is counted in the report.

    Args:
        lake: The lake.
        moments: Name under which the moments are kept.
        choice: Which of them, and how; all by default.
        name: Name of the database.
        replace: Add a version if the database exists.
        workers: Number of processes.
        executor: Runs the shards instead.
        on_progress: Called before the first shard and after each one.

    Raises:
        BadParameter: No moments are kept under this name, or a setting is wrong.
        EmptyResult: No moment satisfies the condition, or none could be cut out.
        DatabaseExists: The database exists and ``replace`` is False.
        QueryError: DuckDB rejects the condition.
    """
    view, choice = open_view(lake), choice or MomentChoice()
    files = view.files
    records.check_free(files, name, replace=replace)
    check_kept(view, moments)
    parameters: dict[str, Any] = {"moments": moments, "ego": choice.ego, "margin": float(choice.margin)}
    query = DatabaseQuery.over(view, choice.database)
    with explaining(choice.where, view.user_columns):
        wanted = query.run(_wanted(query, choice), parameters).to_pylist()
    if not wanted:
        raise EmptyResult(f"{name}: none of the moments kept as {moments!r} satisfies {choice.where!r}")
    items: dict[str, list[RawItem]] = {}
    for row in wanted:
        window = MomentWindow(
            row["definition"], row["first_timestep"], row["last_timestep"], row["track_id"] or "", row["other_id"] or ""
        )
        values = {"moment": dataclasses.asdict(window), "value": row["value"], "id": row["made_id"]}
        text = json.dumps(values | {"ego": choice.ego, "margin": float(choice.margin)})
        item = RawItem(f"{row['scenario_id']}@{row['made_id'].rpartition('@')[2]}", text)
        items.setdefault(row["split"], []).append(item)
    shards = [
        Shard(DATASET, moments, split, f"moments-{part}", "", of_part, ParentOptions(lake=str(files.root)))
        for split, of_split in items.items()
        for part, of_part in bucket(of_split).items()
    ]
    run = executor or executor_for(workers, len(shards))
    report = write_shards(files, MomentScenarios, shards, f"filter --moments {moments}", run, on_progress)
    query = DatabaseQuery.over(view.refresh(), choice.database)
    made = query.query("operations/cut_moments", {"wanted": _wanted(query, choice)})
    try:
        saved = query.make("moments", name, made, parameters, replace=replace, allow_empty=False)
    except EmptyResult as error:
        raise EmptyResult(
            f"{name}: none of {len(wanted):,} moments can be cut out; SELECT DISTINCT message FROM quarantine WHERE "
            f"dataset = '{DATASET}' says why"
        ) from error
    return CutMoments(saved, len(wanted), report)


def _wanted(query: DatabaseQuery, choice: MomentChoice) -> str:
    """Return the query for the moments that are chosen."""
    ranking = IN_ORDER if choice.order_by is None else ranked(choice.order_by)
    limit = "9223372036854775807" if choice.limit is None else str(choice.limit)
    fields = {"conditions": f"({choice.where}\n)", "ranking": ranking, "limit": limit}
    return query.query("operations/kept_moments", fields)
