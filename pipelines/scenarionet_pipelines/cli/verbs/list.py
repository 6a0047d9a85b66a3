"""``scenarionet list``: list the content of a lake."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import SNAPSHOT, LakeVerb

if TYPE_CHECKING:
    from scenarionet_data.query.lake_view import LakeView


class ListVerb(LakeVerb):
    """List the datasets, databases and snapshots of a lake."""

    examples = (
        "scenarionet list lake",
        "scenarionet list lake --json",
    )
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        found = describe(self.open_view())
        self.say(found, content_lines(found))


def describe(lake: LakeView) -> dict[str, Any]:
    """Return the content of a lake as it is printed by ``--json``."""
    from scenarionet_data.query.named_sql import ANALYTICS

    queries = [ANALYTICS.load(name) for name in ("summary", "quarantine_reasons", "defect_reasons")]
    # As Arrow tables: Polars takes 0.2 s to import.
    splits, quarantine, defects = (lake.arrow(query.text, query.bind({})) for query in queries)
    databases = [lake.record(name) for name in lake.databases]
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


def content_lines(found: dict[str, Any]) -> Iterator[str]:
    """Yield the content of a lake as tables."""
    yield f"{found['lake']}, snapshot {found['snapshot']}"
    splits = found["splits"]
    if splits:
        yield from ("", *table([row.values() for row in splits], [name.replace("_", " ") for name in splits[0]]))
    else:
        yield "No scenarios yet: scenarionet convert DATASET RAW LAKE"
    if found["quarantined"]:
        yield f"\n{count(found['quarantined'], 'scenario')} in quarantine: scenarionet sql LAKE quarantine_reasons"
    if found["defects"]:
        number = count(found["defects"], "row")
        yield f"\n{number} or features dropped or assumed: scenarionet sql LAKE defect_reasons"
    if found["databases"]:
        databases = []
        for db in found["databases"]:
            made = f"{db['operation']} of {', '.join(db['parents']) or 'the lake'} at snapshot {db['snapshot']}"
            databases.append((db["reference"], db["count"], made, db["created_at"]))
        yield from ("", *table(databases, ("database", "scenarios", "made by", "at")))
    if found["snapshots"]:
        snapshots = [(s["number"], s["operation"], s["created_at"]) for s in reversed(found["snapshots"])]
        yield from ("", *table(snapshots, ("snapshot", "made by", "at")))
