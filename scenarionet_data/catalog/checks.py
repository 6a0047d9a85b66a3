"""Checks: rules that a lake's content must satisfy, one a file in ``sql/checks``.

-- hard: Every heading lies in [-pi, pi).
SELECT scenario_id, '...' AS detail FROM ... WHERE ...

A hard rule is structural and judged by a scenario's own rows: it is asked while converting, too (see ``audit``). A
rule about the lake is as hard, and asks how its files fit together. A soft rule asks whether recorded motion is
plausible, within the budgets that the dataset's converter declares; real recordings break it now and then.

What breaks a rule is a scenario; or a shared map or a shard, which has no scenario_id and is named in the detail.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from itertools import islice

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.catalog.database import Database
from scenarionet_data.catalog.engine import Engine
from scenarionet_data.catalog.lake import Lake
from scenarionet_data.catalog.named_sql import CHECKS
from scenarionet_data.catalog.statements import quoted
from scenarionet_data.conversion.runners import Run
from scenarionet_data.converters.base import Budgets
from scenarionet_data.errors import LakeError, QueryError
from scenarionet_data.store import manifests
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.snapshot import Snapshot

_KINDS = ("hard", "lake", "soft")
_NUM_EXAMPLES = 5

PARTITION = ("dataset", "version", "split")


@dataclass(frozen=True)
class Check:
    """A rule.

    Attributes:
        name: Its file's name.
        doc: What holds when nothing breaks it.
        kind: hard, lake or soft.
        query: Selects scenario_id and detail of what breaks it.
    """

    name: str
    doc: str
    kind: str
    query: str

    @property
    def is_hard(self) -> bool:
        """Whether what breaks it cannot be trusted."""
        return self.kind != "soft"


@dataclass(frozen=True)
class CheckResult:
    """What a check found.

    Attributes:
        name, doc, is_hard: Of the check.
        is_met: Nothing breaks it; or, of a soft one, no more scenarios of any dataset than its budget allows.
        num_scenarios: Scenarios that break it.
        num_others: Shared maps or shards that break it.
        examples: The first few: scenario id (None for a map or shard) and detail.
    """

    name: str
    doc: str
    is_hard: bool
    is_met: bool
    num_scenarios: int
    num_others: int
    examples: tuple[tuple[str | None, str], ...]


@dataclass(frozen=True)
class Findings:
    """What checks found in a lake or database.

    Attributes:
        checks: Those that were run, hard ones first.
        rows: What breaks them: check, is_hard, scenario_id, dataset, version, split, detail; by check and scenario.
        totals: Scenarios looked at: dataset, version, split, scenarios.
        broken_files: Files that are gone or of another size: file and reason.
        holder: The lake at the snapshot that was looked at.
        database: Whose members were looked at; None for the whole lake.
    """

    checks: tuple[Check, ...]
    rows: pa.Table
    totals: pa.Table
    broken_files: pa.Table
    holder: Lake
    database: Database | None

    def broken_ids(self, *, is_strict: bool = False) -> pa.Array:
        """Scenarios that break a hard rule, or with ``is_strict`` any, each once."""
        rows = self.rows if is_strict else self.rows.filter(pc.field("is_hard"))
        return pc.unique(rows["scenario_id"].drop_null())

    def adding(self, name: str, doc: str, broken: Sequence[tuple[str, str]]) -> Findings:
        """These, and a hard rule that was asked elsewhere.

        Args:
            name, doc: The rule.
            broken: Scenario id and detail of what breaks it.
        """
        ids, details = (_texts(column) for column in zip(*broken, strict=True)) if broken else (_texts(()), _texts(()))
        check = Check(name, doc, "hard", f"SELECT unnest({ids}) AS scenario_id, unnest({details}) AS detail")
        rows = self.holder.arrow(_query(check, "")).cast(_ROWS)
        return replace(self, checks=(check, *self.checks), rows=pa.concat_tables([rows, self.rows]))

    @cached_property
    def results(self) -> list[CheckResult]:
        """One of each check."""
        return [self._result(check) for check in self.checks]

    def _result(self, check: Check) -> CheckResult:
        rows = self.rows.filter(pc.field("check") == check.name)
        num_others = rows["scenario_id"].null_count
        is_met = not rows.num_rows or (not check.is_hard and not num_others and self._is_within_budget(rows))
        examples = rows.slice(0, _NUM_EXAMPLES).select(["scenario_id", "detail"]).to_pylist()
        return CheckResult(
            name=check.name,
            doc=check.doc,
            is_hard=check.is_hard,
            is_met=is_met,
            num_scenarios=rows.num_rows - num_others,
            num_others=num_others,
            examples=tuple((row["scenario_id"], row["detail"]) for row in examples),
        )

    def _is_within_budget(self, rows: pa.Table) -> bool:
        broken = _by_dataset(rows.group_by("dataset").aggregate([("scenario_id", "count")]), "scenario_id_count")
        totals = _by_dataset(self.totals.group_by("dataset").aggregate([("scenarios", "sum")]), "scenarios_sum")
        return all(broken[name] <= converters.budgets(name).outliers * totals[name] for name in broken)


def _by_dataset(counted: pa.Table, column: str) -> dict[str, int]:
    return dict(zip(counted["dataset"].to_pylist(), counted[column].to_pylist(), strict=True))


def names() -> list[str]:
    """Checks there are, sorted."""
    return CHECKS.names()


def load(name: str) -> Check:
    """A check by name.

    Raises:
        UnknownQuery: The message lists the nearest names.
        QueryError: Its first line does not say which kind it is.
    """
    found = CHECKS.load(name)
    kind, _, doc = found.doc.partition(": ")
    if kind not in _KINDS:
        raise QueryError(f"sql/checks/{name}.sql: wanted a first line '-- hard: <rule>', or lake or soft for hard")
    return Check(name, doc, kind, found.text.rstrip().rstrip(";"))


def run_checks(
    lake: Lake, database: Database | str | None = None, names: Iterable[str] | None = None
) -> list[CheckResult]:
    """Run checks over a lake or the members of a database, hard ones first; see :func:`find`."""
    return find(lake, database, names).results


Progress = Callable[[int, int], None]
"""Called with checks done and checks to do."""


def find(
    lake: Lake,
    database: Database | str | None = None,
    names: Iterable[str] | None = None,
    on_progress: Progress | None = None,
    run: Run | None = None,
) -> Findings:
    """Everything that breaks a rule in a lake, or among the members of a database.

    Args:
        lake: At the snapshot to check.
        database: Look only at its members; shards and shared maps are not looked at then.
        names: Which checks; all of them for None.
        on_progress: Told before the first check and after each.
        run: Asks the rules elsewhere, for example on a cluster, a job each; here, one after the other, unless given.

    Raises:
        UnknownQuery: There is no check of such a name.
        LakeError: A file that the snapshot needs to list its scenarios is gone.
    """
    chosen = sorted((load(name) for name in (CHECKS.names() if names is None else names)), key=_rank)
    members = lake.database(database) if isinstance(database, str) else database
    holder = lake if members is None else lake.resolve(members)[0]
    inquest = _Inquest(holder, members)
    reference = None if members is None else members.reference
    jobs = [_Rule(str(holder.root), holder.snapshot.number, reference, check) for check in chosen]
    answers = ((rule.check.name, inquest.rows(rule.check)) for rule in jobs) if run is None else run(jobs, _ask)
    found: dict[str, pa.Table] = {}
    for number in range(len(jobs) + 1):
        if on_progress:
            on_progress(number, len(jobs))
        found.update(islice(answers, 1))
    totals = inquest.totals()
    inquest.close()
    rows = pa.concat_tables([_ROWS.empty_table(), *(found[check.name].cast(_ROWS) for check in chosen)])
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
        return self._engine.arrow(_query(check, self._scope), **self._tables)

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


_ROWS = pa.schema(
    [
        ("check", pa.string()),
        ("is_hard", pa.bool_()),
        ("scenario_id", pa.string()),
        *((name, pa.string()) for name in PARTITION),
        ("detail", pa.string()),
    ]
)


def _texts(values: Sequence[str]) -> str:
    """SQL for a list of texts."""
    return f"[{', '.join(map(quoted, values))}]::VARCHAR[]"


def _rank(check: Check) -> tuple[bool, str]:
    return not check.is_hard, check.name


def _query(check: Check, scope: str) -> str:
    """A check's query, one row for each scenario, with where that belongs."""
    return f"""
        SELECT
            '{check.name}' AS "check", {check.is_hard} AS is_hard, b.scenario_id::VARCHAR AS scenario_id,
            any_value(m.dataset) AS dataset, any_value(m.version) AS version, any_value(m.split) AS split,
            min(b.detail) AS detail
        FROM (FROM (SELECT scenario_id::VARCHAR AS scenario_id, detail FROM ({check.query})) {scope}) AS b
        LEFT JOIN metadata_rows AS m ON m.scenario_id = b.scenario_id
        GROUP BY b.scenario_id, if(b.scenario_id IS NULL, b.detail, NULL)
        ORDER BY scenario_id, detail"""


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
