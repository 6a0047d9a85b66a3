"""Checks: rules that a lake's content must satisfy, one a file in ``sql/checks``.

-- hard: Every file is there.
SELECT scenario_id, '...' AS detail FROM ... WHERE ...

A hard rule is structural: what breaks it cannot be trusted. A soft one asks whether recorded motion is plausible;
real recordings break it now and then.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.catalog import named_sql
from scenarionet_data.catalog.database import Database
from scenarionet_data.catalog.engine import Engine
from scenarionet_data.catalog.lake import Lake
from scenarionet_data.errors import LakeError, QueryError, UnknownQuery
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.snapshot import Snapshot

_FOLDER = "checks"
NUM_EXAMPLES = 5


@dataclass(frozen=True)
class Check:
    """A rule.

    Attributes:
        name: Its file's name.
        doc: What holds when nothing breaks it.
        is_hard: Whether it is structural.
        query: Selects scenario_id and detail of what breaks it.
    """

    name: str
    doc: str
    is_hard: bool
    query: str


@dataclass(frozen=True)
class CheckResult:
    """What a check found.

    Attributes:
        name, doc, is_hard: Of the check.
        num_scenarios: Scenarios that break it.
        examples: The first few of them: scenario id and detail.
    """

    name: str
    doc: str
    is_hard: bool
    num_scenarios: int
    examples: tuple[tuple[str, str], ...]

    @property
    def is_met(self) -> bool:
        """Whether no scenario breaks it."""
        return not self.num_scenarios


def names() -> list[str]:
    """Checks there are, sorted."""
    return named_sql.names(_FOLDER)


def load(name: str) -> Check:
    """A check by name.

    Raises:
        UnknownQuery: The message lists the nearest names.
        QueryError: Its first line does not say whether it is hard or soft.
    """
    found = named_sql.load(_FOLDER, name, UnknownQuery)
    kind, _, doc = found.doc.partition(": ")
    if kind not in ("hard", "soft"):
        raise QueryError(f"sql/checks/{name}.sql: wanted a first line '-- hard: <rule>' or '-- soft: <rule>'")
    return Check(name, doc, kind == "hard", found.text.rstrip().rstrip(";"))


def run_checks(
    lake: Lake, database: Database | str | None = None, names: Iterable[str] | None = None
) -> list[CheckResult]:
    """Run checks over a lake or the members of a database, hard ones first.

    Args:
        lake: At the snapshot to check.
        database: Look only at its members.
        names: Which checks; all of them for None.

    Raises:
        UnknownQuery: There is no check of such a name.
        LakeError: A file that the snapshot needs to list its scenarios is gone.
    """
    chosen = [load(name) for name in (named_sql.names(_FOLDER) if names is None else names)]
    holder = lake if database is None else lake.resolve(database)[0]
    broken = _broken_files(holder.files, holder.snapshot)
    engine = Engine(holder.files, holder.snapshot, without=broken["file"].to_pylist())
    tables, scope = {"broken_files": broken}, ""
    if database is not None:
        found = lake.database(database) if isinstance(database, str) else database
        tables["members"], scope = found.members, "SEMI JOIN members USING (scenario_id)"
    results = [_run(engine, check, scope, tables) for check in chosen]
    engine.close()
    return sorted(results, key=lambda result: (not result.is_hard, result.name))


def _run(engine: Engine, check: Check, scope: str, tables: Mapping[str, pa.Table]) -> CheckResult:
    query = (
        "SELECT scenario_id, min(detail) AS detail, count(*) OVER () AS num_scenarios "
        f"FROM ({check.query}) {scope} GROUP BY scenario_id ORDER BY scenario_id LIMIT {NUM_EXAMPLES}"
    )
    rows = engine.arrow(query, **tables).to_pylist()
    examples = tuple((row["scenario_id"], row["detail"]) for row in rows)
    return CheckResult(check.name, check.doc, check.is_hard, rows[0]["num_scenarios"] if rows else 0, examples)


def _broken_files(files: LakeFiles, snapshot: Snapshot) -> pa.Table:
    """Files of a snapshot that are gone or of another size than when they were written: file and reason."""
    needed = [name for name in (*snapshot.metadata, *snapshot.manifests) if not files.has(name)]
    if needed:
        raise LakeError(
            f"{files.path(needed[0])}: gone, and {len(needed) - 1} more that list the lake's scenarios; "
            "restore them from a copy of the lake, or open an older snapshot"
        )
    shards = snapshots.shard_table(files, snapshot)
    names, sizes = (pc.list_flatten(shards[column]).to_pylist() for column in ("files", "sizes"))
    broken = [
        {"file": name, "reason": f"not {size} bytes long" if files.has(name) else "gone"}
        for name, size in zip(names, sizes, strict=True)
        if not files.has(name, size)
    ]
    return pa.Table.from_pylist(broken, schema=pa.schema({"file": pa.string(), "reason": pa.string()}))
