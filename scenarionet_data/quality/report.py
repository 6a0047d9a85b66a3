"""Reports of checks: violations in a lake or database, and whether they are within the budgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.quality.rules import VIOLATIONS, Check
from scenarionet_data.query.engine import Engine
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.statements import quoted

_NUM_EXAMPLES = 5


@dataclass(frozen=True)
class CheckResult:
    """Result of one check.

    Attributes:
        name, doc, is_hard: Of the check.
        is_met: No violations; for a soft rule, no more scenarios of any dataset than its budget allows.
        num_scenarios: Number of scenarios that violate it.
        num_others: Number of shared maps or shards that violate it.
        examples: The first few violations: scenario id (None for a map or shard) and detail.
    """

    name: str
    doc: str
    is_hard: bool
    is_met: bool
    num_scenarios: int
    num_others: int
    examples: tuple[tuple[str | None, str], ...]


@dataclass(frozen=True)
class CheckReport:
    """Results of checks of a lake or database.

    Attributes:
        checks: Checks that ran, hard ones first.
        rows: Violations: check, is_hard, scenario_id, dataset, version, split, detail; by check and scenario.
        totals: Numbers of checked scenarios: dataset, version, split, scenarios.
        broken_files: Files that are missing or damaged, and were left out: file and reason.
        view: The lake at the snapshot that was checked.
        database: The database whose members were checked; None for the whole lake.
    """

    checks: tuple[Check, ...]
    rows: pa.Table
    totals: pa.Table
    broken_files: pa.Table
    view: LakeView
    database: DatabaseRecord | None

    def failing_ids(self, *, strict: bool = False) -> pa.Array:
        """Return the unique ids of scenarios that violate a hard rule, or with ``strict`` any rule."""
        rows = self.rows if strict else self.rows.filter(pc.field("is_hard"))
        return pc.unique(rows["scenario_id"].drop_null())

    def with_check(self, name: str, doc: str, violations: Sequence[tuple[str, str]]) -> CheckReport:
        """Return the report with a further hard rule that was checked outside the lake.

        Args:
            name, doc: The rule.
            violations: Scenario id and detail of each violation.
        """
        ids, details = (", ".join(quoted(each[column]) for each in violations) for column in (0, 1))
        query = f"SELECT unnest([{ids}]::VARCHAR[]) AS scenario_id, unnest([{details}]::VARCHAR[]) AS detail"
        check = Check(name, doc, "hard", query)
        engine = Engine(self.view.files, self.view.snapshot, without=self.broken_files["file"].to_pylist())
        rows = engine.arrow(check.sql()).cast(VIOLATIONS)
        engine.close()
        return replace(self, checks=(check, *self.checks), rows=pa.concat_tables([rows, self.rows]))

    @cached_property
    def results(self) -> list[CheckResult]:
        """One result per check."""
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
