"""``scenarionet list``: list the content of a lake."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, snapshot_option

if TYPE_CHECKING:
    from scenarionet_data import Lake


@verb("list", "scenarionet list lake", "scenarionet list lake --json")
@lake_argument
@snapshot_option
@json_option
def command(lake: str, snapshot: int | None, as_json: bool) -> None:
    """List the datasets, databases and snapshots of a lake."""
    from scenarionet_data import Lake

    found = _describe(Lake(lake, snapshot))
    if as_json:
        print_json(found)
    else:
        _print(found)


def _describe(lake: Lake) -> dict[str, Any]:
    return {
        "lake": str(lake.root),
        "snapshot": lake.snapshot.number,
        "splits": lake.summary().to_dicts(),
        "quarantined": int(lake.named_query("quarantine_reasons")["scenarios"].sum()),
        "defects": int(lake.named_query("defect_reasons")["rows"].sum()),
        "databases": [_database(lake, name) for name in lake.databases],
        "snapshots": [
            {"number": found.number, "created_at": found.created_at, "operation": found.operation}
            for found in lake.history()
        ],
    }


def _database(lake: Lake, name: str) -> dict[str, Any]:
    found = lake.database(name)
    return {"name": name, "reference": found.reference} | asdict(found.lineage)


def _print(found: dict[str, Any]) -> None:
    click.echo(f"{found['lake']}, snapshot {found['snapshot']}")
    splits = found["splits"]
    if splits:
        click.echo()
        print_table([row.values() for row in splits], [name.replace("_", " ") for name in splits[0]])
    else:
        click.echo("No scenarios yet: scenarionet convert DATASET RAW LAKE")
    if found["quarantined"]:
        number = count(found["quarantined"], "scenario")
        click.echo(f"\n{number} in quarantine: scenarionet sql LAKE quarantine_reasons")
    if found["defects"]:
        number = count(found["defects"], "row")
        click.echo(f"\n{number} or features dropped or assumed: scenarionet sql LAKE defect_reasons")
    if found["databases"]:
        click.echo()
        databases = [(d["reference"], d["count"], _origin(d), d["created_at"]) for d in found["databases"]]
        print_table(databases, ("database", "scenarios", "made by", "at"))
    if found["snapshots"]:
        click.echo()
        snapshots = [(s["number"], s["operation"], s["created_at"]) for s in reversed(found["snapshots"])]
        print_table(snapshots, ("snapshot", "made by", "at"))


def _origin(lineage: dict[str, Any]) -> str:
    """Summary of how a database was made."""
    parents = ", ".join(lineage["parents"]) or "the lake"
    return f"{lineage['operation']} of {parents} at snapshot {lineage['snapshot']}"
