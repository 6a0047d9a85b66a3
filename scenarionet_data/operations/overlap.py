"""What two databases share that train and test must not share: one rule a file in ``sql/overlaps``."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.database_query import Pool, StaleDatabaseWarning
from scenarionet_data.query.named_sql import OVERLAPS, NamedSql

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake

_SCENARIOS = "(SELECT * FROM (SELECT parent, scenario_id FROM members) JOIN metadata USING (scenario_id))"
_GONE = "SELECT count(*) AS n FROM {members} ANTI JOIN metadata_rows USING (scenario_id)"


@dataclass(frozen=True)
class Overlap:
    """What two databases share in one respect.

    Attributes:
        first, second: ``name@version`` of the two.
        kind: Name of the rule.
        doc: What it means.
        num_first, num_second: Members of each that are concerned.
        examples: What is shared (a scenario, a log, ...), with one member of each.
    """

    first: str
    second: str
    kind: str
    doc: str
    num_first: int
    num_second: int
    examples: tuple[tuple[str, str, str], ...]


def overlap(lake: Lake, *which: Database | str, only: Sequence[str] | None = None) -> list[Overlap]:
    """What databases share, two by two: scenarios, contents, logs, seconds of a log, drives.

    Args:
        lake: The lake; its snapshot is asked about the members.
        *which: Two databases or more.
        only: Rules to apply; all unless given. ``near_duplicate`` reads tracks, the others metadata alone.

    Returns:
        One for each pair of databases and rule, empty ones too.

    Raises:
        UnknownQuery: There is no such rule.
    """
    if len(which) < 2:
        raise BadParameter(f"overlap: wanted two databases or more, found {len(which)}")
    rules = [OVERLAPS.load(kind) for kind in (only or OVERLAPS.names())]
    found = [lake.database(each) for each in which]
    for database in found:
        _warn_of_gone(lake, database)
    return [_apply(lake, pair, rule) for pair in combinations(found, 2) for rule in rules]


def _warn_of_gone(lake: Lake, database: Database) -> None:
    gone = int(lake.arrow(_GONE.format(members=database.relation))["n"][0].as_py())
    if gone:
        warnings.warn(
            f"{gone:,} of {len(database):,} members of {database.reference} are not in snapshot "
            f"{lake.snapshot.number}: only their ids and contents are compared",
            StaleDatabaseWarning,
            stacklevel=3,
        )


def _apply(lake: Lake, pair: tuple[Database, Database], rule: NamedSql) -> Overlap:
    pool = Pool(lake, pair)
    keyed = rule.text.replace("{scenarios}", _SCENARIOS)
    (row,) = pool.run(pool.query("operations/overlap", keyed=keyed), {}).to_pylist()
    examples = tuple(tuple(example.values()) for example in row["examples"] or ())
    first, second = pool.references
    return Overlap(first, second, rule.name, rule.doc, row["num_first"], row["num_second"], examples)
