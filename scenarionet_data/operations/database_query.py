"""What a database is made of: its parents' members, and the snapshot that is asked about them."""

from __future__ import annotations

import json
import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypedDict

import pyarrow as pa

from scenarionet_data import version
from scenarionet_data.databases import record as databases
from scenarionet_data.databases import user_columns, writer
from scenarionet_data.databases.record import Database, Lineage
from scenarionet_data.errors import BadParameter, EmptyResult, NoSuchSnapshot, ScenarioNotFound
from scenarionet_data.schema.package_data import SQL
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake

_WHOLE_LAKE = "(SELECT *, 1.0::DOUBLE AS weight, scenario_id AS place FROM metadata)"
_MEMBERS = (
    "(SELECT * FROM metadata JOIN (SELECT scenario_id, weight, position AS place FROM members) USING (scenario_id))"
)
_CHANGED = (
    "SELECT count(*) AS n, min(scenario_id) AS example "
    "FROM (SELECT scenario_id, hash(scenario_id) AS id_hash, content_hash FROM {members}) "
    "ANTI JOIN (SELECT hash(scenario_id) AS id_hash, content_hash FROM metadata_rows) USING (id_hash, content_hash)"
)
"""Members that are not in a snapshot as they were, told by 128 bits: of ids as text, a million take 70 MB more."""

_DRAWN = "('0x' || substr(md5(concat($seed, ':', {name})), 1, 13))::BIGINT / 4503599627370496.0"
"""A number in [0, 1) for a name and the seed: the same on every machine, for every version of the engine."""


class StaleDatabaseWarning(UserWarning):
    """Members of a database have changed in the newest snapshot; it is read from the one it was made on."""


class Saving(TypedDict, total=False):
    """How a database is saved.

    Attributes:
        replace: Make a further version of an existing database, which is refused otherwise.
        allow_empty: Save it without members too.
    """

    replace: bool
    allow_empty: bool


@dataclass(frozen=True)
class Pool:
    """What scenarios are chosen from.

    Attributes:
        lake: At the snapshot that is asked.
        parents: The databases they are members of; none for the whole lake.
    """

    lake: Lake
    parents: tuple[Database, ...] = ()

    @property
    def members(self) -> str:
        """SQL for the rows of all parents, each with ``parent``, the place of its database."""
        return " UNION ALL ".join(
            f"SELECT {number} AS parent, * FROM {parent.relation}" for number, parent in enumerate(self.parents)
        )

    @property
    def references(self) -> list[str]:
        """``name@version`` of the parents."""
        return [parent.reference for parent in self.parents]

    def __len__(self) -> int:
        """Scenarios of the first parent, or of the whole lake."""
        return len(self.parents[0]) if self.parents else len(self.lake)

    @property
    def bare(self) -> str:
        """SQL for what a database keeps of the scenarios, and their ``place``."""
        if self.parents:
            return "(SELECT scenario_id, weight, content_hash, position AS place FROM members)"
        return "(SELECT scenario_id, 1.0::DOUBLE AS weight, content_hash, scenario_id AS place FROM metadata)"

    def query(self, file: str, /, **words: str) -> str:
        """The SQL of a file below ``sql/``, with ``{pool}`` and other ``{words}`` replaced."""
        lines = (SQL / f"{file}.sql").read_text("utf-8").splitlines()
        text = "\n".join(line for line in lines if not line.startswith("--"))
        for word, value in ({"pool": _MEMBERS if self.parents else _WHOLE_LAKE} | words).items():
            text = text.replace(f"{{{word}}}", value)
        return text

    def run(self, query: str, parameters: Mapping[str, Any]) -> pa.Table:
        """Rows of a query over the snapshot's views and ``members``."""
        return self.lake.arrow(self._over_members(query), parameters, layers=self._layers(query))

    def batches(self, query: str, parameters: Mapping[str, Any]) -> Generator[pa.RecordBatch, None, None]:
        """Like :meth:`run`, some rows at a time, see :meth:`Engine.batches`."""
        return self.lake.batches(self._over_members(query), parameters, layers=self._layers(query))

    def _layers(self, query: str) -> list[str]:
        """Layers that a query asks; it has every column of the pool, but is asked for those it names."""
        return user_columns.named(self.lake.layers, query)

    def _over_members(self, query: str) -> str:
        """The query with ``members`` to ask: read again where it is named twice, and not kept in memory."""
        return (
            f"WITH members AS NOT MATERIALIZED ({self.members}) SELECT * FROM (\n{query}\n)" if self.parents else query
        )

    def make(self, operation: str, name: str, query: str, parameters: Mapping[str, Any], saving: Saving) -> Database:
        """Run a query that selects scenario_id, weight and content_hash, and save its rows as a database."""
        recorded = as_recorded(parameters)
        return self.save(self.lineage(operation, query, recorded), name, self.batches(query, recorded), saving)

    def save(
        self,
        lineage: Lineage,
        name: str,
        members: Generator[pa.RecordBatch, None, None],
        saving: Saving,
        at_least: int = 0,
    ) -> Database:
        """Save members that a query selects.

        Args:
            lineage: The query, see :meth:`lineage`.
            name: Name of the database.
            members: scenario_id, weight and content_hash, in order; closed in the end.
            saving: See :class:`Saving`.
            at_least: How many there have to be.

        Raises:
            EmptyResult: There are none, and that was not asked for.
            BadParameter: There are fewer than there have to be.
            DatabaseExists: The name is taken, and replacing was not asked for.
        """
        replace = saving.get("replace", False)
        databases.check_free(self.lake.files, name, replace=replace)
        with closing(members), writer.drafts(self.lake.files, [name]) as made:
            draft = made[name]
            for rows in members:
                draft.add(rows)
            if draft.count < at_least:
                raise BadParameter(
                    f"wanted {at_least:,} scenarios of {len(self):,}, but only {draft.count:,} can be drawn"
                )
            if not (draft.count or saving.get("allow_empty", False)):
                raise EmptyResult(
                    f"{name}: no scenario is left of {len(self):,}; loosen the conditions, or --allow-empty"
                )
            draft.finish(lineage)
            return draft.publish(name, replace=replace)

    def lineage(self, operation: str, query: str, parameters: dict[str, Any]) -> Lineage:
        """How a database is made here; its draft knows how many members it has."""
        return Lineage(
            operation=operation,
            sql=query,
            parameters=parameters,
            parents=self.references,
            snapshot=self.lake.snapshot.number,
            created_at=snapshots.now(),
            count=0,
            created_with=version.name_and_version(),
            layers=[f"{name}@{self.lake.layers[name]}" for name in self._layers(query)],
        )


def of(lake: Lake, *parents: Database | str | None, held: int = 1) -> Pool:
    """The pool of some databases, at a snapshot that holds the members of the first ``held`` unchanged.

    That is the lake's own snapshot, else the newest that one of them was made on.

    Raises:
        ScenarioNotFound: No snapshot holds them all.
    """
    found = tuple(lake.database(parent) for parent in parents if parent is not None)
    return Pool(holding(lake, found[:held]), found)


def holding(lake: Lake, wanted: Sequence[Database]) -> Lake:
    """The lake at a snapshot that holds every member of some databases unchanged."""
    stale = [found for found in wanted if num_changed(lake, found)]
    if not stale:
        return lake
    first = stale[0]
    older = _made_on(lake, max(stale, key=lambda found: found.lineage.snapshot))
    for found in wanted:
        count, example = _changed(older, found)
        if count:
            raise ScenarioNotFound(
                f"{lake.root}: no snapshot holds the members of {' and '.join(w.reference for w in wanted)} as they "
                f"were: {count:,} of {len(found):,} of {found.reference} are not in snapshot {older.snapshot.number}, "
                f"for example {example}; move on first: `scenarionet rebase {lake.root} {first.name}`"
            )
    warnings.warn(
        f"{num_changed(lake, first)} of {len(first)} members of {first.reference} changed after snapshot "
        f"{first.lineage.snapshot} and are read from it; `scenarionet rebase {lake.root} {first.name}` moves on",
        StaleDatabaseWarning,
        stacklevel=2,
    )
    return older


def num_changed(lake: Lake, database: Database) -> int:
    """Members that a snapshot does not hold, or not as they were."""
    return _changed(lake, database)[0]


def _changed(lake: Lake, database: Database) -> tuple[int, str]:
    """How many members changed, and one of them."""
    (row,) = lake.arrow(_CHANGED.format(members=database.relation)).to_pylist()
    return row["n"], row["example"]


def _made_on(lake: Lake, database: Database) -> Lake:
    """The lake at the snapshot a database was made on."""
    try:
        return lake.at(database.lineage.snapshot)
    except NoSuchSnapshot as error:
        raise NoSuchSnapshot(
            f"{database.reference} was made on snapshot {database.lineage.snapshot}, which is gone, and members of it "
            f"have changed since; `scenarionet rebase {lake.root} {database.name}` makes it again on the newest"
        ) from error


def drawn(name: str) -> str:
    """SQL for a number in [0, 1) that a name and ``$seed`` decide, whatever the machine and engine.

    Args:
        name: SQL for the name.
    """
    return _DRAWN.format(name=name)


def as_recorded(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as the lineage keeps them: what runs is what can be run again.

    Raises:
        BadParameter: JSON has no word for one.
    """
    try:
        recorded: dict[str, Any] = json.loads(json.dumps(dict(parameters)))
    except TypeError as error:
        raise BadParameter(
            f"{error}: a parameter is a number, a text, a truth value or a list of them; "
            "pass a date as text and compare with $name::DATE"
        ) from error
    return recorded


def check_column(lake: Lake, column: str, purpose: str) -> None:
    """Refuse what is no column of ``metadata``.

    Raises:
        BadParameter: Naming those there are.
    """
    columns = lake.arrow("SELECT * FROM metadata LIMIT 0").column_names
    if column not in columns:
        raise BadParameter(f"no column {column!r} {purpose}; there are {', '.join(columns)}")
