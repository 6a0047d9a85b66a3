"""The data of a report, collected from a lake; independent of its layout."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.execution.progress import Progress
from scenarionet_data.operations.comparison import DatabaseStatistics
from scenarionet_data.plots import draw_distributions, thumbnail
from scenarionet_data.plots.style import as_png
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.quality.scorecard import Scorecard, make_scorecard
from scenarionet_data.schema import tables
from scenarionet_pipelines.report.measures import COLUMNS, ScenarioMeasures, read_measures, select_examples

PICTURE_SIZE = (400, 260)
"""Width and height of the picture of a scenario [pixel]; shown at half this size or larger."""

_FACTS = ("duration", "ego_distance", "num_objects")


@dataclass(frozen=True)
class ScenarioPicture:
    """A picture of a scenario.

    Attributes:
        scenario_id: Id of the scenario.
        reason: Measures in which the scenario is extreme; empty for other scenarios.
        facts: Values of the columns duration, ego_distance and num_objects.
        png: The picture as a PNG file.
    """

    scenario_id: str
    reason: str
    facts: dict[str, Any]
    png: bytes


@dataclass(frozen=True)
class DatabaseSection:
    """Data about one database, or about the whole lake.

    Attributes:
        statistics: DatabaseStatistics of its scenarios.
        origin: How the database was made; empty for the whole lake.
        missing: Number of scenarios without a value, for each nullable column that has missing values.
        scorecard: Violations of the quality rules; None if they were not checked.
        pictures: Pictures by group: typical, extreme and random scenarios.
    """

    statistics: DatabaseStatistics
    origin: str
    missing: dict[str, int]
    scorecard: Scorecard | None
    pictures: dict[str, list[ScenarioPicture]]

    @property
    def name(self) -> str:
        """Name of the database, or of the lake."""
        return self.statistics.name


@dataclass(frozen=True)
class ReportContents:
    """Data of a report.

    Attributes:
        name: Name of the lake's folder.
        snapshot, created_at: The snapshot and its time.
        summary: Scenarios, objects and hours by dataset, version and split.
        quarantined: Number of scenarios in quarantine.
        cities: Number of different cities.
        sections: Databases in the requested order, or the whole lake.
        distributions: Picture of the distribution of each measure that differs, by title; a PNG file with a line for
            each database, or each dataset of the lake.
        constants: Value of each measure that is the same in all scenarios, by title.
    """

    name: str
    snapshot: int
    created_at: str
    summary: list[dict[str, Any]]
    quarantined: int
    cities: int
    sections: tuple[DatabaseSection, ...]
    distributions: Mapping[str, bytes]
    constants: Mapping[str, float]


def gather(
    lake: Lake,
    databases: Sequence[str] = (),
    *,
    is_checked: bool = True,
    on_progress: Progress | None = None,
) -> ReportContents:
    """Collect the data of a report.

    Args:
        lake: The lake.
        databases: Names, or ``name@version``; without any, the whole lake is described.
        is_checked: Check the quality rules.
        on_progress: Called with the percentage done.

    Raises:
        DatabaseNotFound: A database does not exist.
    """
    names: Sequence[str | None] = databases or [None]
    sections, measured = list[DatabaseSection](), list[ScenarioMeasures]()

    def report(half: int, done: int, total: int) -> None:
        """Report progress: half of each section are checks, half are pictures."""
        if on_progress is not None:
            share = (2 * len(sections) + half + done / max(total, 1)) / (2 * len(names))
            on_progress(round(100 * share), 100, 0)

    def on_check(done: int, total: int, _: int) -> None:
        report(0, done, total)

    for name, statistics in zip(names, lake.compare(*databases), strict=True):
        view = lake if name is None else lake.restrict_to(name)
        card = make_scorecard(run_checks(lake, name, on_progress=on_check)) if is_checked else None
        measured.append(read_measures(view))
        pictures = _pictures(view, select_examples(measured[-1]), partial(report, 1))
        origin = "" if name is None else lake.database(name).lineage.origin
        sections.append(DatabaseSection(statistics, origin, _missing(view), card, pictures))
    values = {title: np.concatenate([each.values[name] for each in measured]) for name, title in COLUMNS.items()}
    known = {title: np.unique(found[np.isfinite(found)]) for title, found in values.items()}
    counts = lake.sql(
        "SELECT (SELECT count(*) FROM quarantine) AS quarantined, (SELECT count(DISTINCT city) FROM metadata) AS cities"
    )
    return ReportContents(
        name=lake.name,
        snapshot=lake.snapshot.number,
        created_at=lake.snapshot.created_at,
        summary=lake.summary().to_dicts(),
        quarantined=counts["quarantined"].item(),
        cities=counts["cities"].item(),
        sections=tuple(sections),
        distributions={
            title: as_png(draw_distributions(lake, [name], databases=databases), dpi=200)
            for name, title in COLUMNS.items()
            if len(known[title]) > 1
        },
        constants={title: float(found[0]) for title, found in known.items() if len(found) == 1},
    )


def _missing(view: Lake) -> dict[str, int]:
    columns = [column.name for column in tables.load("metadata").columns if column.nullable]
    counted = ", ".join(f'count(*) - count("{name}") AS "{name}"' for name in columns)
    (row,) = view.arrow(f"SELECT {counted} FROM metadata").to_pylist()
    shown = {name: count for name, count in row.items() if count and not name.endswith(("_file", "_row_group", "_row"))}
    return dict(sorted(shown.items(), key=lambda item: -item[1]))


def _pictures(
    view: Lake, chosen: dict[str, list[tuple[str, str]]], on_picture: Callable[[int, int], None]
) -> dict[str, list[ScenarioPicture]]:
    ids = list(dict.fromkeys(scenario_id for group in chosen.values() for scenario_id, _ in group))
    if not ids:
        return {}
    loader = ScenarioLoader(view, ids)
    query = f"SELECT scenario_id, {', '.join(_FACTS)} FROM metadata WHERE scenario_id IN (SELECT unnest($ids))"
    known = {row["scenario_id"]: row for row in view.arrow(query, {"ids": ids}).to_pylist()}
    drawn: dict[str, bytes] = {}
    for number, scenario_id in enumerate(ids):
        drawn[scenario_id] = thumbnail(loader[number], PICTURE_SIZE)
        on_picture(number + 1, len(ids))
    return {
        group: [ScenarioPicture(each, reason, known[each], drawn[each]) for each, reason in members]
        for group, members in chosen.items()
    }
