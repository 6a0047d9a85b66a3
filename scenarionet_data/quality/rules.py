"""Rules that a lake's content must satisfy, one a file in ``sql/checks``; ``checks`` asks them.

-- hard: Every heading lies in [-pi, pi).
SELECT scenario_id, '...' AS detail FROM ... WHERE ...

A hard rule is structural and judged by a scenario's own rows: it is asked while converting, too (see ``audit``). A
rule about the lake is as hard, and asks how its files fit together. A soft rule asks whether recorded motion is
plausible, within the budgets that the dataset's converter declares; real recordings break it now and then.

What breaks a rule is a scenario; or a shared map or a shard, which has no scenario_id and is named in the detail.
"""

from __future__ import annotations

from dataclasses import dataclass

import pyarrow as pa

from scenarionet_data.errors import QueryError
from scenarionet_data.query.named_sql import CHECKS

_KINDS = ("hard", "lake", "soft")

PARTITION = ("dataset", "version", "split")

BROKEN = pa.schema(
    [
        ("check", pa.string()),
        ("is_hard", pa.bool_()),
        ("scenario_id", pa.string()),
        *((name, pa.string()) for name in PARTITION),
        ("detail", pa.string()),
    ]
)
"""Columns of what breaks a rule."""


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

    def sql(self, scope: str = "") -> str:
        """The query with one row for each scenario, and where that belongs: columns as in BROKEN.

        Args:
            scope: A join that leaves only some scenarios.
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
