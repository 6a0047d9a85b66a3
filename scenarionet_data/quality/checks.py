"""Checks: asks a lake, or the members of a database, which of the rules of ``sql/checks`` they break."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import islice

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.databases.record import Database
from scenarionet_data.errors import LakeError
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.lake.lake import Lake
from scenarionet_data.quality import rules
from scenarionet_data.quality.report import CheckResult, Findings
from scenarionet_data.quality.rules import BROKEN, Check
from scenarionet_data.query.engine import Engine
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.snapshot import Snapshot


def run_checks(
    lake: Lake, database: Database | str | None = None, names: Iterable[str] | None = None
) -> list[CheckResult]:
    """Run checks over a lake or the members of a database, hard ones first; see :func:`find`."""
    return find(lake, database, names).results


def find(
    lake: Lake,
    database: Database | str | None = None,
    names: Iterable[str] | None = None,
    on_progress: Progress | None = None,
    executor: Executor | None = None,
) -> Findings:
    """Everything that breaks a rule in a lake, or among the members of a database.

    Args:
        lake: At the snapshot to check.
        database: Look only at its members; shards and shared maps are not looked at then.
        names: Which checks; all of them for None.
        on_progress: Told before the first check and after each.
        executor: Runs the checks, one job each, for example on a cluster; by default they run in this process.

    Raises:
        UnknownQuery: There is no check of such a name.
        LakeError: A file that the snapshot needs to list its scenarios is gone.
    """
    chosen = sorted((rules.load(name) for name in (rules.names() if names is None else names)), key=_rank)
    members = lake.database(database) if isinstance(database, str) else database
    holder = lake if members is None else lake.resolve(members)[0]
    inquest = _Inquest(holder, members)
    reference = None if members is None else members.reference
    jobs = [_Rule(str(holder.root), holder.snapshot.number, reference, check) for check in chosen]
    answers = (
        ((rule.check.name, inquest.rows(rule.check)) for rule in jobs) if executor is None else executor(jobs, _ask)
    )
    found: dict[str, pa.Table] = {}
    for number in range(len(jobs) + 1):
        if on_progress:
            on_progress(number, len(jobs), 0)
        found.update(islice(answers, 1))
    totals = inquest.totals()
    inquest.close()
    rows = pa.concat_tables([BROKEN.empty_table(), *(found[check.name].cast(BROKEN) for check in chosen)])
    return Findings(tuple(chosen), rows, totals, inquest.broken_files, holder, members)


class _Inquest:
    """A lake, or the members of a database of it, open for the questions of rules.

    Attributes:
        broken_files: Files that are gone or of another size: file and reason.
    """

    def __init__(self, holder: Lake, members: Database | None) -> None:
        self.broken_files = _broken_files(holder.files, holder.snapshot)
        self._tables = {"broken_files": self.broken_files, "budgets": budget_table(holder)}
        self._scope = ""
        if members is not None:
            self._tables["members"], self._scope = members.members, "SEMI JOIN members USING (scenario_id)"
        self._engine = Engine(holder.files, holder.snapshot, without=self.broken_files["file"].to_pylist())

    def rows(self, check: Check) -> pa.Table:
        """What breaks a rule."""
        return self._engine.arrow(check.sql(self._scope), **self._tables)

    def totals(self) -> pa.Table:
        """Scenarios looked at, by partition."""
        return self._engine.arrow(
            "SELECT dataset, version, split, count(*) AS scenarios "
            f"FROM metadata_rows {self._scope} GROUP BY ALL ORDER BY ALL",
            **self._tables,
        )

    def close(self) -> None:
        """Give back what the questions took."""
        self._engine.close()


@dataclass(frozen=True)
class _Rule:
    """A rule to ask elsewhere: of which snapshot of a lake, and of which database's members."""

    root: str
    snapshot: int
    database: str | None
    check: Check


def _ask(rule: _Rule) -> tuple[str, pa.Table]:
    """A rule's name and what breaks it, on a worker."""
    return rule.check.name, _inquest(rule.root, rule.snapshot, rule.database).rows(rule.check)


@lru_cache(maxsize=1)
def _inquest(root: str, snapshot: int, database: str | None) -> _Inquest:
    """Opened once a process: looking for broken files takes longer than most questions."""
    holder = Lake(root, snapshot)
    return _Inquest(holder, None if database is None else holder.database(database))


def budget_table(lake: Lake) -> pa.Table:
    """The table ``budgets`` that soft rules join: one row a dataset of the lake, as its converter declares it."""
    datasets = pc.unique(manifests.column(lake.files, lake.snapshot, "dataset")).to_pylist()
    rows = [{"dataset": name, **asdict(converters.budgets(name))} for name in sorted(datasets)]
    numbers = [(name, pa.float64()) for name in asdict(Budgets())]
    return pa.Table.from_pylist(rows, schema=pa.schema([("dataset", pa.string()), *numbers]))


def _rank(check: Check) -> tuple[bool, str]:
    return not check.is_hard, check.name


def _broken_files(files: LakeFiles, snapshot: Snapshot) -> pa.Table:
    """Files of a snapshot that are gone or of another size than when they were written: file and reason."""
    lists = [*snapshot.metadata, *snapshot.manifests]
    needed = [name for name, size in zip(lists, files.sizes(lists), strict=True) if size is None]
    if needed:
        raise LakeError(
            f"{files.url(needed[0])}: gone, and {len(needed) - 1} more that list the lake's scenarios; "
            "restore them from a copy of the lake, or open an older snapshot"
        )
    shards = manifests.shard_table(files, snapshot)
    names, sizes = (pc.list_flatten(shards[column]).to_pylist() for column in ("files", "sizes"))
    wanted = dict(zip(names, sizes, strict=True))  # shards may share files
    broken = [
        {"file": name, "reason": "gone" if found is None else f"not {size} bytes long"}
        for (name, size), found in zip(wanted.items(), files.sizes(list(wanted)), strict=True)
        if found != size
    ]
    return pa.Table.from_pylist(broken, schema=pa.schema({"file": pa.string(), "reason": pa.string()}))
