"""Checks: which scenarios of a lake, or members of a database, violate the rules of ``sql/checks``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import islice

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_data.quality import rules
from scenarionet_data.quality.report import CheckReport
from scenarionet_data.quality.rules import VIOLATIONS, Check
from scenarionet_data.query.engine import Engine
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.snapshot import Snapshot


def run_checks(
    lake: LakeLike,
    database: DatabaseRecord | str | None = None,
    names: Iterable[str] | None = None,
    *,
    on_progress: Progress | None = None,
    executor: Executor | None = None,
) -> CheckReport:
    """Check a lake, or the members of a database.

    Args:
        lake: The lake, its path or its URL.
        database: Check only its members; shards and shared maps are not checked then.
        names: Names of the checks; all by default.
        on_progress: Called before the first check and after each.
        executor: Runs the checks, one job each, for example on a cluster; by default they run in this process.

    Raises:
        UnknownQuery: No check has one of these names.
        LakeError: A manifest of the snapshot is missing or damaged.
    """
    view = open_view(lake)
    if isinstance(names, str):
        raise BadParameter(f"names: wanted a list of checks, found {names!r}; write names=[{names!r}]")
    checks = [rules.load(name) for name in (rules.names() if names is None else names)]
    checks.sort(key=lambda check: (not check.is_hard, check.name))
    record = None if database is None else view.record(database)
    if record is not None:
        view, _ = view.resolve(record)
    session = CheckSession(view, record, _broken_files(view.files, view.snapshot))
    answers: Iterator[tuple[str, pa.Table]] = ((check.name, session.violations(check)) for check in checks)
    if executor is not None:
        broken = tuple((row["file"], row["reason"]) for row in session.broken_files.to_pylist())
        jobs = [_CheckJob(str(view.root), view.snapshot.number, record, broken, check) for check in checks]
        answers = executor(jobs, _run)
    found: dict[str, pa.Table] = {}
    for number in range(len(checks) + 1):
        if on_progress:
            on_progress(number, len(checks), 0)
        found.update(islice(answers, 1))
    totals = session.totals()
    session.close()
    rows = pa.concat_tables([VIOLATIONS.empty_table(), *(found[check.name].cast(VIOLATIONS) for check in checks)])
    return CheckReport(tuple(checks), rows, totals, session.broken_files, view, record)


class CheckSession:
    """A lake, or the members of one of its databases, open for checks.

    Args:
        view: The lake at the snapshot to check.
        database: Check only its members.
        broken_files: Files that are missing or damaged, which are left out: file and reason.
    """

    def __init__(self, view: LakeView, database: DatabaseRecord | None, broken_files: pa.Table) -> None:
        self.broken_files = broken_files
        self._tables = {"broken_files": self.broken_files, "budgets": budget_table(view)}
        self._scope = ""
        if database is not None:
            self._tables["members"], self._scope = database.members, "SEMI JOIN members USING (scenario_id)"
        self._engine = Engine(view.files, view.snapshot, without=self.broken_files["file"].to_pylist())

    def violations(self, check: Check) -> pa.Table:
        """Return the violations of a rule."""
        return self._engine.arrow(check.sql(self._scope), tables=self._tables)

    def totals(self) -> pa.Table:
        """Return the number of checked scenarios by partition."""
        query = (
            "SELECT dataset, version, split, count(*) AS scenarios "
            f"FROM metadata_rows {self._scope} GROUP BY ALL ORDER BY ALL"
        )
        return self._engine.arrow(query, tables=self._tables)

    def close(self) -> None:
        """Close the connection."""
        self._engine.close()


@dataclass(frozen=True)
class _CheckJob:
    """A check to run on a worker: the lake, its snapshot, the database, files that are left out, and the check."""

    root: str
    snapshot: int
    database: DatabaseRecord | None
    broken: tuple[tuple[str, str], ...]
    check: Check


def _run(job: _CheckJob) -> tuple[str, pa.Table]:
    """Return the name of a check and its violations; runs on a worker."""
    reference = job.database.reference if job.database and job.database.is_saved else None
    if job.database is not None and reference is None:
        session = CheckSession(LakeView(job.root, job.snapshot), job.database, _file_table(job.broken))
    else:
        session = _session(job.root, job.snapshot, reference, job.broken)
    return job.check.name, session.violations(job.check)


@lru_cache(maxsize=1)
def _session(root: str, snapshot: int, database: str | None, broken: tuple[tuple[str, str], ...]) -> CheckSession:
    """Open a session once per process, which takes longer than most checks."""
    view = LakeView(root, snapshot)
    return CheckSession(view, None if database is None else view.record(database), _file_table(broken))


def budget_table(view: LakeView) -> pa.Table:
    """Return the table ``budgets`` that soft rules join: one row per dataset, as its converter declares it."""
    datasets = pc.unique(manifests.column(view.files, view.snapshot, "dataset")).to_pylist()
    rows = [{"dataset": name, **asdict(converters.budgets(name))} for name in sorted(datasets)]
    numbers = [(name, pa.float64()) for name in asdict(Budgets())]
    return pa.Table.from_pylist(rows, schema=pa.schema([("dataset", pa.string()), *numbers]))


def _broken_files(files: LakeFiles, snapshot: Snapshot) -> pa.Table:
    """Return files of a snapshot that are missing or damaged: file and reason."""
    shards = manifests.shard_table(files, snapshot)
    names, sizes = (pc.list_flatten(shards[column]).to_pylist() for column in ("files", "sizes"))
    written = dict.fromkeys(snapshot.metadata) | dict(zip(names, sizes, strict=True))  # shards may share files
    found = dict(zip(written, files.sizes(list(written)), strict=True))
    with ThreadPoolExecutor() as pool:  # digests are computed without the interpreter lock
        reasons = pool.map(lambda name: _reason(files, name, written[name], found[name]), written)
        return _file_table((name, reason) for name, reason in zip(written, reasons, strict=True) if reason)


def _reason(files: LakeFiles, name: str, written: int | None, found: int | None) -> str | None:
    """What is wrong with a file, given its size when it was written, if recorded, and now."""
    if found is None:
        return "gone"
    if written not in (None, found):
        return f"not {written} bytes long"
    try:
        files.check_bytes(name)
    except LakeError:
        return "damaged"
    return None


def _file_table(broken: Iterable[tuple[str, str]]) -> pa.Table:
    rows = [{"file": name, "reason": reason} for name, reason in broken]
    return pa.Table.from_pylist(rows, schema=pa.schema({"file": pa.string(), "reason": pa.string()}))
