"""Overlap of databases, which would leak from train to test: one rule per file in ``sql/overlaps``."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.database_query import DatabaseQuery, several
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.members import StaleDatabaseWarning, relation
from scenarionet_data.query.named_sql import OVERLAPS

_SCENARIOS = "(SELECT * FROM (SELECT parent, scenario_id FROM members) JOIN metadata USING (scenario_id))"


@dataclass(frozen=True)
class DatabaseOverlap:
    """Overlap of two databases by one rule.

    Attributes:
        first, second: ``name@version`` of the two.
        kind: Name of the rule.
        doc: Description of the rule.
        num_first, num_second: Overlapping members of each.
        examples: Shared keys (a scenario, a log, ...), each with one member of both databases.
    """

    first: str
    second: str
    kind: str
    doc: str
    num_first: int
    num_second: int
    examples: tuple[tuple[str, str, str], ...]


def overlap(
    view: LakeView, *databases: DatabaseRecord | str, kinds: Sequence[str] | None = None
) -> list[DatabaseOverlap]:
    """Find what databases share, pair by pair; see :meth:`Lake.overlap <scenarionet_data.Lake.overlap>`."""
    if isinstance(kinds, str) or not isinstance(kinds, Iterable | None):
        raise BadParameter(f"kinds: wanted a list of rules, found {kinds!r}; write kinds=[{kinds!r}]")
    rules = [OVERLAPS.load(kind) for kind in (kinds or OVERLAPS.names())]
    records = [view.record(each) for each in several("overlap", databases)]
    for database in records:
        members, tables = relation(database, view.rows)
        query = f"SELECT count(*) FROM {members} ANTI JOIN metadata_rows USING (scenario_id)"
        missing = view.engine.arrow(query, tables=tables)[0][0].as_py()
        if missing:
            warnings.warn(
                f"{missing:,} of {len(database):,} members of {database.reference} are not in snapshot "
                f"{view.snapshot.number}: only their ids and contents are compared",
                StaleDatabaseWarning,
                stacklevel=3,
            )
    found = []
    for first, second in combinations(records, 2):
        pair = DatabaseQuery(view, (first, second))
        for rule in rules:
            keyed = rule.text.replace("{scenarios}", _SCENARIOS)
            (row,) = pair.run(pair.query("operations/overlap", {"keyed": keyed}), {}).to_pylist()
            examples = tuple(tuple(example.values()) for example in row["examples"] or ())
            counts = row["num_first"], row["num_second"]
            found.append(DatabaseOverlap(first.reference, second.reference, rule.name, rule.doc, *counts, examples))
    return found
