"""Everything a report shows, gathered from a lake; nothing here knows how a page looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.execution.progress import Progress
from scenarionet_data.operations.comparison import DatabaseStatistics
from scenarionet_data.plots import thumbnail
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.quality.scorecard import Scorecard, make_scorecard
from scenarionet_data.schema import tables
from scenarionet_pipelines.report.measures import Spread, choose, measure, spreads

PICTURE = (400, 260)
"""Width and height of a scenario's picture [pixel], shown at half the size or more."""

_FACTS = ("duration", "ego_distance", "num_objects")


@dataclass(frozen=True)
class Picture:
    """A scenario to show.

    Attributes:
        scenario_id: Which.
        why: What it is the most of; empty when it is just one of them.
        facts: By column: duration, ego_distance and num_objects.
        png: The picture.
    """

    scenario_id: str
    why: str
    facts: dict[str, Any]
    png: bytes


@dataclass(frozen=True)
class Part:
    """A database, or the whole lake.

    Attributes:
        statistics: What its scenarios are like.
        made: How it was made: the operation and the snapshot; empty for the whole lake.
        missing: Scenarios that lack a value, by column, of columns that may be null and are not always so.
        scorecard: What breaks which rule; None when rules were not asked.
        pictures: Typical, extreme and random scenarios.
    """

    statistics: DatabaseStatistics
    made: str
    missing: dict[str, int]
    scorecard: Scorecard | None
    pictures: dict[str, list[Picture]]

    @property
    def name(self) -> str:
        """As the statistics have it."""
        return self.statistics.name


@dataclass(frozen=True)
class Contents:
    """A report.

    Attributes:
        name: The lake's folder.
        snapshot, created_at: What was looked at, and when that was written.
        summary: Scenarios, objects and hours by dataset, version and split.
        quarantined: Scenarios that were rejected while converting.
        cities: Places of recording that are named.
        parts: The databases, in the order asked for.
        spreads: How each measure is spread over them, or over the lake's datasets.
    """

    name: str
    snapshot: int
    created_at: str
    summary: list[dict[str, Any]]
    quarantined: int
    cities: int
    parts: tuple[Part, ...]
    spreads: tuple[Spread, ...]


def gather(
    lake: Lake, databases: Sequence[str] = (), *, is_checked: bool = True, on_progress: Progress | None = None
) -> Contents:
    """Look at a lake and some of its databases; at the whole lake when none is named.

    Args:
        lake: The lake.
        databases: Names, or ``name@version``.
        is_checked: Ask the rules of ``sql/checks`` too.
        on_progress: Told as it goes.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    steps = _Steps(on_progress, max(1, len(databases)))
    statistics = lake.compare(*databases)
    names: Sequence[str | None] = databases or [None]
    views = [lake if name is None else lake.restrict_to(name) for name in names]
    parts = []
    for name, view, said in zip(names, views, statistics, strict=True):
        card = make_scorecard(run_checks(lake, name, on_progress=steps.within)) if is_checked else None
        pictures = _pictures(view, choose(measure(view)), steps)
        parts.append(Part(said, _made(lake, name), _missing(view), card, pictures))
        steps.end_part()
    counts = lake.sql(
        "SELECT (SELECT count(*) FROM quarantine) AS quarantined, (SELECT count(DISTINCT city) FROM metadata) AS cities"
    )
    return Contents(
        name=lake.name,
        snapshot=lake.snapshot.number,
        created_at=lake.snapshot.created_at,
        summary=lake.summary().to_dicts(),
        quarantined=counts["quarantined"].item(),
        cities=counts["cities"].item(),
        parts=tuple(parts),
        spreads=tuple(spreads(lake, databases)),
    )


class _Steps:
    """Progress over parts, each of so many steps: as many as the rules and pictures of the part that is under way."""

    def __init__(self, told: Progress | None, num_parts: int) -> None:
        self._told = told
        self._num_parts = num_parts
        self._part = self._done = 0
        self._of_part = 1

    def within(self, done: int, total: int, scenarios: int) -> None:  # noqa: ARG002
        """So much of a stage is done."""
        self._say(done, total, 0)

    def drawn(self, done: int, total: int) -> None:
        """So many pictures are drawn."""
        self._say(done, total, 1)

    def end_part(self) -> None:
        """The next part follows."""
        self._part += 1

    def _say(self, done: int, total: int, stage: int) -> None:
        if self._told is None:
            return
        share = (self._part + (stage + done / max(total, 1)) / 2) / self._num_parts
        self._told(round(100 * share), 100, 0)


def _made(lake: Lake, name: str | None) -> str:
    if name is None:
        return ""
    lineage = lake.database(name).lineage
    source = ", ".join(lineage.parents) or "the lake"
    return f"{lineage.operation} of {source} at snapshot {lineage.snapshot}"


def _missing(view: Lake) -> dict[str, int]:
    columns = [column.name for column in tables.load("metadata").columns if column.nullable]
    counted = ", ".join(f'count(*) - count("{name}") AS "{name}"' for name in columns)
    (row,) = view.arrow(f"SELECT {counted} FROM metadata").to_pylist()
    shown = {name: count for name, count in row.items() if count and not name.endswith(("_file", "_row_group", "_row"))}
    return dict(sorted(shown.items(), key=lambda item: -item[1]))


def _pictures(view: Lake, chosen: dict[str, list[tuple[str, str]]], steps: _Steps) -> dict[str, list[Picture]]:
    ids = list(dict.fromkeys(scenario_id for group in chosen.values() for scenario_id, _ in group))
    if not ids:
        return {}
    loader = ScenarioLoader(view, ids)
    facts = view.arrow(
        f"SELECT scenario_id, {', '.join(_FACTS)} FROM metadata WHERE scenario_id IN (SELECT unnest($ids))",
        {"ids": ids},
    ).to_pylist()
    known = {row["scenario_id"]: row for row in facts}
    drawn: dict[str, bytes] = {}
    for number, scenario_id in enumerate(ids):
        steps.drawn(number, len(ids))
        drawn[scenario_id] = thumbnail(loader[number], PICTURE)
    steps.drawn(len(ids), len(ids))
    return {
        group: [Picture(each, why, known[each], drawn[each]) for each, why in members]
        for group, members in chosen.items()
    }
