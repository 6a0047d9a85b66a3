"""HTML cards of scenarios, lakes and databases for notebooks: small pictures and properties.

Text from recordings and names is escaped; pictures are embedded.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from scenarionet_data.errors import MissingDependency, ScenarioNetError
from scenarionet_data.lake.database import Database
from scenarionet_data.lake.lake import Lake
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.description import ScenarioDescription

_PICTURES = 4
_CELL = "padding:2px 12px 2px 0;text-align:left;vertical-align:top;font-size:12px"

_PARTITIONS = """
SELECT dataset, version, split, count(*) AS scenarios, round(sum(duration) / 3600, 2) AS hours,
    round(avg(ego_distance), 1) AS mean_ego_distance, round(avg(num_objects), 1) AS mean_num_objects
FROM metadata GROUP BY ALL ORDER BY ALL
"""

_EXAMPLES = """
SELECT scenario_id FROM metadata ORDER BY hash(scenario_id) LIMIT $count
"""
"""A few scenarios, the same ones every time."""


def card(shown: ScenarioDescription | ScenarioLoader | Database | Lake) -> str:
    """Return the card of a scenario, database, lake or loader."""
    if isinstance(shown, ScenarioDescription):
        return scenario_card(shown)
    if isinstance(shown, ScenarioLoader):
        return loader_card(shown)
    return database_card(shown) if isinstance(shown, Database) else lake_card(shown)


def scenario_card(scenario: ScenarioDescription) -> str:
    """Return a picture and the properties of a scenario."""
    tracks, source = scenario.tracks, scenario.source
    seconds = float(scenario.timestamps[-1] - scenario.timestamps[0])
    properties = {
        "scenario": scenario.id,
        "split": scenario.split,
        "time": f"{scenario.num_timesteps} timesteps, {seconds:.1f} s, now at {scenario.current_timestep}",
        "objects": f"{len(tracks)}, the ego is {scenario.ego_id}",
        "lights": f"{len(scenario.lights)}",
        "map": f"{len(scenario.map):,} features" if scenario.map else "none",
        "place": ", ".join(filter(None, (source.city, source.date))) or "unknown",
        "licence": source.licence,
    }
    return _card(_table_of(properties), [_picture(scenario)])


def database_card(database: Database) -> str:
    """Return the properties and first scenarios of a database."""
    lineage = database.lineage
    properties = {
        "database": database.reference,
        "scenarios": f"{len(database):,}",
        "made by": lineage.operation + (f" of {', '.join(lineage.parents)}" if lineage.parents else ""),
        "with": " ".join(lineage.sql.split())[:300],
        "when": f"{lineage.created_at}, on snapshot {lineage.snapshot}",
    }
    first = database.members["scenario_id"][:_PICTURES].to_pylist()
    return _card(_table_of(properties), _pictures(database.view, first))


def loader_card(loader: ScenarioLoader) -> str:
    """Return the number of scenarios of a loader, and its first ones."""
    return _card(_table_of({"loader": f"{len(loader):,} scenarios"}), [_picture(s) for s in loader[:_PICTURES]])


def lake_card(lake: Lake) -> str:
    """Return the contents of a lake by dataset and split, its databases, and some of its scenarios."""
    rows = lake.sql(_PARTITIONS)
    table = (
        _table(rows.columns, rows.rows()) if len(rows) else "<p>no scenarios yet: <code>scenarionet convert</code></p>"
    )
    databases = ", ".join(lake.databases) or "none yet"
    properties = {"lake": str(lake.root), "snapshot": f"{lake.snapshot.number}", "databases": databases}
    examples = lake.sql(_EXAMPLES, {"count": _PICTURES})["scenario_id"].to_list()
    return _card(_table_of(properties) + table, _pictures(lake, examples))


def properties_card(
    properties: Mapping[str, str], rows: Iterable[Sequence[Any]] = (), columns: Sequence[str] = ()
) -> str:
    """Return a card without pictures: properties, and a table of rows if there are any."""
    rows = list(rows)
    return _card(_table_of(properties) + (_table(columns, rows) if rows else ""), [])


def _pictures(view: LakeView, ids: Sequence[str]) -> list[str]:
    try:
        return [_picture(scenario) for scenario in ScenarioLoader(view, ids)]
    except ScenarioNetError as error:  # the properties are shown all the same
        return [f"<small>no pictures: {escape(str(error))}</small>"]


def _picture(scenario: ScenarioDescription) -> str:
    try:
        from scenarionet_data.plots import thumbnail

        data = base64.b64encode(thumbnail(scenario, (220, 165))).decode("ascii")
    except MissingDependency as error:
        return f"<small>{escape(str(error))}</small>"
    words = escape(scenario.id, quote=True)
    return f'<img src="data:image/png;base64,{data}" width="220" height="165" alt="{words}" title="{words}">'


def _table_of(properties: Mapping[str, str]) -> str:
    rows = "".join(
        f'<tr><th style="{_CELL}">{escape(name)}</th>'
        f'<td style="{_CELL};word-break:break-word">{escape(words)}</td></tr>'
        for name, words in properties.items()
    )
    return f"<table>{rows}</table>"


def _table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    head = "".join(f'<th style="{_CELL}">{escape(name)}</th>' for name in columns)
    body = "".join(
        "<tr>" + "".join(f'<td style="{_CELL}">{escape(_word(value))}</td>' for value in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _word(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:,}" if isinstance(value, int | float) else str(value)


def _card(facts: str, pictures: list[str]) -> str:
    row = f'<div style="display:flex;gap:6px;flex-wrap:wrap">{"".join(pictures)}</div>' if pictures else ""
    return f'<div style="display:flex;gap:16px;flex-wrap:wrap;align-items:flex-start">{row}<div>{facts}</div></div>'
