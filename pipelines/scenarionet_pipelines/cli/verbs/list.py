"""``scenarionet list``: list the content of a lake."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.verb import SNAPSHOT, LakeVerb

if TYPE_CHECKING:
    from scenarionet_data import Lake


class ListVerb(LakeVerb):
    """List the datasets, databases and snapshots of a lake."""

    examples = (
        "scenarionet list lake",
        "scenarionet list lake --json",
    )
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_data import Lake

        found = describe(Lake(self.lake, self.snapshot))
        if self.as_json:
            print_json(found)
        else:
            print_content(found)


def describe(lake: Lake) -> dict[str, Any]:
    """Return the content of a lake as it is printed by ``--json``."""
    from scenarionet_data.query.named_sql import ANALYTICS

    queries = [ANALYTICS.load(name) for name in ("summary", "quarantine_reasons", "defect_reasons")]
    # As Arrow tables: Polars takes 0.2 s to import.
    splits, quarantine, defects = (lake.arrow(query.text, query.bind({})) for query in queries)
    databases = [lake.database(name) for name in lake.databases]
    return {
        "lake": str(lake.root),
        "snapshot": lake.snapshot.number,
        "splits": splits.to_pylist(),
        "quarantined": sum(quarantine["scenarios"].to_pylist()),
        "defects": sum(defects["rows"].to_pylist()),
        "databases": [{"name": db.name, "reference": db.reference} | asdict(db.lineage) for db in databases],
        "snapshots": [
            {"number": found.number, "created_at": found.created_at, "operation": found.operation}
            for found in lake.history()
        ],
    }


def print_content(found: dict[str, Any]) -> None:
    """Print the content of a lake as tables."""
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
        databases = [
            (
                db["reference"], db["count"],
                f"{db['operation']} of {', '.join(db['parents']) or 'the lake'} at snapshot {db['snapshot']}",
                db["created_at"],
            )
            for db in found["databases"]
        ]  # fmt: skip
        print_table(databases, ("database", "scenarios", "made by", "at"))
    if found["snapshots"]:
        click.echo()
        snapshots = [(s["number"], s["operation"], s["created_at"]) for s in reversed(found["snapshots"])]
        print_table(snapshots, ("snapshot", "made by", "at"))
