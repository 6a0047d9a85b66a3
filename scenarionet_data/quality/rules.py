"""Rules for the content of a lake, one per file in ``sql/checks``; :mod:`.checks` runs them.

-- hard: Every heading is in [-pi, pi).
SELECT scenario_id, '...' AS detail FROM ... WHERE ...

Hard rules are structural and need only the rows of one scenario; they are also checked during conversion (see
:mod:`.audit`). Lake rules are as strict, and check the consistency of files. Soft rules check whether recorded motion
is plausible, within the budgets that the converter of the dataset declares; some real recordings violate them.

A scenario violates a rule, or a shared map or a shard, which has no scenario_id and is named in the detail.
"""

from __future__ import annotations

from dataclasses import dataclass

import pyarrow as pa

from scenarionet_data.errors import QueryError
from scenarionet_data.query.named_sql import CHECKS

_KINDS = ("hard", "lake", "soft")

PARTITION = ("dataset", "version", "split")

VIOLATIONS = pa.schema(
    [
        ("check", pa.string()),
        ("is_hard", pa.bool_()),
        ("scenario_id", pa.string()),
        *((name, pa.string()) for name in PARTITION),
        ("detail", pa.string()),
    ]
)
"""Columns of violations."""


@dataclass(frozen=True)
class Check:
    """A rule.

    Attributes:
        name: Name of its file.
        doc: The rule, as a statement.
        kind: hard, lake or soft.
        query: Selects scenario_id and detail of violations.
    """

    name: str
    doc: str
    kind: str
    query: str

    @property
    def is_hard(self) -> bool:
        """Whether data that violates it cannot be trusted."""
        return self.kind != "soft"

    def sql(self, scope: str = "") -> str:
        """Return a query with one row per scenario, with its partition: columns as in VIOLATIONS.

        Args:
            scope: Join that keeps some scenarios only.
        """
        return f"""
            SELECT
                '{self.name}' AS "check", {self.is_hard} AS is_hard, b.scenario_id::VARCHAR AS scenario_id,
                any_value(m.dataset) AS dataset, any_value(m.version) AS version, any_value(m.split) AS split,
                min(b.detail) AS detail
            FROM (FROM (SELECT scenario_id::VARCHAR AS scenario_id, detail FROM ({self.query})) {scope}) AS b
            LEFT JOIN metadata_rows AS m ON m.scenario_id = b.scenario_id
            GROUP BY b.scenario_id, if(b.scenario_id IS NULL, b.detail, NULL)
            ORDER BY scenario_id, detail"""


def names() -> list[str]:
    """Return the names of all checks, sorted."""
    return CHECKS.names()


def load(name: str) -> Check:
    """Load a check by name.

    Raises:
        UnknownQuery: No such check; the message suggests similar names.
        QueryError: Its first line does not state the kind.
    """
    found = CHECKS.load(name)
    kind, _, doc = found.doc.partition(": ")
    if kind not in _KINDS:
        raise QueryError(f"sql/checks/{name}.sql: wanted a first line '-- hard: <rule>', or lake or soft for hard")
    return Check(name, doc, kind, found.text.rstrip().rstrip(";"))
