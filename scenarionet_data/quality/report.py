"""Findings: what checks found in a lake or database, and what of it counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.databases.record import Database
from scenarionet_data.lake.lake import Lake
from scenarionet_data.quality.rules import BROKEN, Check
from scenarionet_data.query.statements import quoted

_NUM_EXAMPLES = 5


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
        rows = self.holder.arrow(check.sql()).cast(BROKEN)
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


def _texts(values: Sequence[str]) -> str:
    """SQL for a list of texts."""
    return f"[{', '.join(map(quoted, values))}]::VARCHAR[]"
