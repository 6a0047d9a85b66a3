"""The verbs of ``scenarionet db``: those that are one call of the library, and one per file the others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING

from scenarionet_pipelines.cli.databases import described, diff_as_json, diff_lines
from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import (
    DATABASES,
    NEW_VERSION,
    CombinationVerb,
    DatabaseVerb,
    LakeVerb,
    argument,
    option,
)

if TYPE_CHECKING:
    from scenarionet_data.operations.lineage import LineageTree


class CheckoutVerb(LakeVerb):
    """Restore an earlier version of a database as its newest version.

    The versions in between are kept. To only read an earlier version, pass DATABASE@VERSION to any verb.
    """

    examples = (
        "scenarionet db checkout lake busy@1",
        "scenarionet db checkout lake busy@1 --json",
    )
    database: str = argument("DATABASE@VERSION")

    def run(self) -> None:
        self.say(*described(self.open().checkout(self.database)))


class CopyVerb(DatabaseVerb):
    """Copy a database, or one of its versions (DATABASE@VERSION), to a new name.

    Only the list of scenarios is copied. Later changes of DATABASE do not affect the copy.
    """

    examples = (
        "scenarionet db copy lake busy paper_train",
        "scenarionet db copy lake busy@1 busy_then --json",
    )
    name: str = argument("NAME")
    replace: bool = NEW_VERSION

    def run(self) -> None:
        self.say(*described(self.open().copy(self.database, name=self.name, replace=self.replace)))


class DiffVerb(LakeVerb):
    """Show which scenarios were added, removed or changed, and which columns changed.

    OLD and NEW are databases (DATABASE or DATABASE@VERSION), or @SNAPSHOT for the whole lake at that snapshot.
    """

    examples = (
        "scenarionet db diff lake busy@1 busy",
        "scenarionet db diff lake @3 @7 --json",
    )
    old: str = argument("OLD")
    new: str = argument("NEW")

    def run(self) -> None:
        diff = self.open().diff(self.old, self.new)
        self.say(diff_as_json(diff), diff_lines(diff))


class DropVerb(DatabaseVerb):
    """Remove a database, or one version of it (DATABASE@VERSION). The scenarios stay in the lake.

    moments:NAME removes the moments that `scenarionet mine --name NAME` has kept.
    """

    examples = (
        "scenarionet db drop lake busy",
        "scenarionet db drop lake moments:risky",
        "scenarionet db drop lake busy@1 --force",
    )
    force: bool = option("Drop it even if other databases were made from it; those cannot be rebuilt.")

    def run(self) -> None:
        from scenarionet_data.storage import kept_moments

        lake, (kind, _, name) = self.open(), self.database.partition(":")
        if kind == kept_moments.FOLDER:
            kept_moments.drop(lake.files, name)
        else:
            lake.drop(self.database, force=self.force)
        self.say({"dropped": self.database}, f"dropped {self.database}")


class IntersectVerb(CombinationVerb):
    """Save the scenarios that are in every one of the databases, in the order of the first."""

    examples = (
        "scenarionet db intersect lake busy far --name both",
        "scenarionet db intersect lake busy@1 busy --name still_busy",
    )

    def run(self) -> None:
        self.say(*described(self.combined(self.open().intersect)))


class LineageVerb(DatabaseVerb):
    """Show how a database was made, with the databases it was made from, as a tree."""

    examples = (
        "scenarionet db lineage lake busy_train",
        "scenarionet db lineage lake busy@1 --sql",
        "scenarionet db lineage lake busy --json",
    )
    with_sql: bool = option("Also print the SQL and its parameters.", "--sql")

    def run(self) -> None:
        found = self.open().lineage(self.database)
        self.say(asdict(found), self.tree(found))

    def tree(self, found: LineageTree, margin: str = "") -> Iterator[str]:
        """Yield how a database was made, then its parents, further to the right."""
        made, inner = "no longer in the lake", margin + "    "
        lineage = found.lineage
        if lineage is not None:
            seed = f", seed {lineage.parameters['seed']}" if "seed" in lineage.parameters else ""
            where = f"snapshot {lineage.snapshot}, {lineage.created_at}, {lineage.created_with}"
            made = f"{count(lineage.count, 'scenario')} by {lineage.operation}{seed}, {where}"
            made += "" if found.is_here else "; its members are not in this lake"
        yield f"{margin}{found.reference}: {made}"
        if lineage is not None and self.with_sql:
            yield indent(lineage.sql, inner + "| ")
            yield from (f"{inner}${name} = {value!r}" for name, value in lineage.parameters.items())
        if len(found.versions) > 1:
            yield f"{inner}versions {', '.join(map(str, found.versions))}"
        if found.children:
            yield f"{inner}used by {', '.join(found.children)}"
        for parent in found.parents:
            yield from self.tree(parent, inner)


class OverlapVerb(LakeVerb):
    """Detect leakage between databases such as train and test, pair by pair.

    The rules are SQL files in sql/overlaps: the same scenario, the same content under another id, scenarios from the
    same recording, scenarios that overlap in time, and scenarios with the same ego trajectory. The last one reads
    tracks. --embedding finds near-duplicates instead, also those that are moved, turned, noisier, a second later, or
    lack some road users: among the nearest by a column that `db embed` wrote, by comparing their motion.
    """

    examples = (
        "scenarionet db overlap lake busy_train busy_val",
        "scenarionet db overlap lake train val test --only same_log --strict",
        "scenarionet db overlap lake train val --embedding v",
    )
    databases: tuple[str, ...] = DATABASES
    only: tuple[str, ...] = option("Apply only this rule; repeatable.", metavar="RULE")
    embedding: str | None = option("Find near-duplicates among the nearest by this embedding.", metavar="NAME")
    strict: bool = option("Exit with code 1 if anything is shared.")

    def run(self) -> bool:
        found = self.open().overlap(*self.databases, kinds=self.only or None, embedding=self.embedding)
        is_clean, rows = not any(each.examples for each in found), []
        for each in found:
            # The first example: the shared key and, unless it is the key itself, a scenario of each database.
            key, *ids = each.examples[0] if each.examples else ("-",)
            example = ": ".join([key, " / ".join(ids)]) if {key} != {*ids} and ids else key
            rows.append((f"{each.first} / {each.second}", each.kind, each.num_first, each.num_second, example))
        head = ("databases", "rule", "of the first", "of the second", "for example")
        self.say({"overlaps": [asdict(each) for each in found], "is_clean": is_clean}, table(rows, head))
        return is_clean or not self.strict


class RebaseVerb(DatabaseVerb):
    """Update a database to the newest snapshot, as a new version, and show what changed.

    The query of the database runs again, after the queries of its parents. Earlier versions are kept.
    """

    examples = (
        "scenarionet db rebase lake busy",
        "scenarionet db rebase lake busy --keep-members --json",
    )
    keep_members: bool = option("Do not run the query; keep the members still in the lake.")

    def run(self) -> None:
        moved = self.open().rebase(self.database, keep_members=self.keep_members)
        lines = [line for diff in moved for line in diff_lines(diff)]
        nothing = f"{self.database} is already on the newest snapshot"
        self.say({"moved": [diff_as_json(diff) for diff in moved]}, lines or nothing)


class RebuildVerb(DatabaseVerb):
    """Run a database's query again on its snapshot and parents, and compare the result.

    Nothing is saved. The exit code is 1 if members, weights or order differ. The folder that `scenarionet db catalogue`
    has written is computed again from the recordings of the lake, and compared to the last bit.
    """

    examples = (
        "scenarionet db rebuild lake busy",
        "scenarionet db rebuild lake busy@1 --json",
        "scenarionet db rebuild lake catalogue",
    )

    def run(self) -> bool:
        from scenarionet_data.catalogue import packing

        if Path(self.database, packing.FILE).exists():
            differences = packing.compare_catalogue(self.open(), self.database)
            same = f"{self.database}: the same, to the last bit"
            self.say({"catalogue": self.database, "differences": differences}, differences or same)
            return not differences
        rebuilt = self.open().rebuild(self.database)
        lines = [f"{rebuilt.reference}: the same {count(rebuilt.diff.counts[0], 'scenario')} in the same order"]
        if not rebuilt.is_same:
            lines = [f"{rebuilt.reference}: NOT the same", *diff_lines(rebuilt.diff)]
        self.say({"reference": rebuilt.reference, "is_same": rebuilt.is_same} | diff_as_json(rebuilt.diff), lines)
        return rebuilt.is_same


class RenameVerb(DatabaseVerb):
    """Rename a database with all its versions.

    Refused if other databases were made from it, because their lineage refers to its name.
    """

    examples = (
        "scenarionet db rename lake busy crowded",
        "scenarionet db rename lake tmp train --json",
    )
    name: str = argument("NAME")

    def run(self) -> None:
        self.open().rename(self.database, name=self.name)
        self.say({"before": self.database, "name": self.name}, f"{self.database} -> {self.name}")


class SubtractVerb(CombinationVerb):
    """Save the scenarios of the first database that are in none of the others, in its order."""

    examples = (
        "scenarionet db subtract lake busy seen --name unseen",
        "scenarionet db subtract lake a b c --name rest",
    )

    def run(self) -> None:
        self.say(*described(self.combined(self.open().subtract)))
