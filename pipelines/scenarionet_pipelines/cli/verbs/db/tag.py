"""``scenarionet db tag``: add, list and remove user columns."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.output import count, table
from scenarionet_pipelines.cli.verb import LakeVerb, argument, option

if TYPE_CHECKING:
    from scenarionet_data import Lake


class TagVerb(LakeVerb):
    """Add a user column to the lake, such as a label, a count, a score or an embedding.

    A user column is a side table keyed by scenario id; no scenario is rewritten. Conditions, SQL and filters use it
    like any other column of metadata, with null for scenarios without a value. Without NAME, the user columns are
    listed. --drop removes one; --force is required if databases depend on it.
    """

    examples = (
        'scenarionet db tag lake fast --where "ego_max_speed > 20"',
        "scenarionet db tag lake cut_ins --event cut_in:max_gap=20",
        'scenarionet db tag lake red_seconds --sql "SELECT scenario_id, count(*) FROM at_red GROUP BY scenario_id"',
        "scenarionet db tag lake score --file scores.csv --column score",
        "scenarionet db tag lake",
        "scenarionet db tag lake --drop score",
        "scenarionet db tag lake --drop score@1 --force",
    )
    name: str | None = argument()
    where: str | None = option("Label: whether this SQL condition over the columns of metadata holds.", metavar="EXPR")
    event: str | None = option("Count: number of occurrences of this event.", metavar="NAME[:KEY=VALUE,...]")
    query: str | None = option("Query that selects scenario_id and one other column.", "--sql", metavar="SELECT")
    file: str | None = option("A .csv or .parquet file with scenario_id and another column.", metavar="FILE")
    column: str | None = option("With --file: the column to use if there are several.", metavar="NAME")
    replace: bool = option("Save a new version if the column exists.")
    drop: str | None = option("Remove a user column, or one version of it (NAME@VERSION).", metavar="NAME")
    force: bool = option("With --drop: even if databases use the column; those cannot be rebuilt.")

    def run(self) -> None:
        opened = self.open()
        given = {"--where": self.where, "--event": self.event, "--sql": self.query, "--file": self.file}
        chosen = [(spelling, value) for spelling, value in given.items() if value is not None]
        if (self.drop and (self.name or chosen or self.column or self.replace)) or (self.force and not self.drop):
            raise BadParameter("--drop NAME takes no other option than --force")
        if self.drop:
            opened.untag(self.drop, force=self.force)
            self.say({"dropped": self.drop}, f"dropped {self.drop}")
            return
        if self.name is None and not chosen:
            self.show_columns(opened)
            return
        if self.name is None:
            raise BadParameter("the column needs a NAME: scenarionet db tag LAKE NAME ...")
        if len(chosen) != 1 or (self.column and not self.file):
            raise BadParameter(f"expected one of {', '.join(given)}; --column requires --file")
        if self.file is not None:
            tagged = opened.tag_from_file(self.name, self.file, self.column, replace=self.replace)
        else:
            tags = {"--where": opened.tag_where, "--event": opened.tag_event, "--sql": opened.tag_by_sql}
            ((spelling, value),) = chosen
            tagged = tags[spelling](self.name, value, replace=self.replace)
        values = f"{tagged.type} for {tagged.count:,} of {count(len(opened), 'scenario')}"
        self.say(asdict(tagged) | {"reference": tagged.reference}, f"{tagged.reference}: {values}")

    def show_columns(self, lake: Lake) -> None:
        """List the user columns of a lake."""
        from scenarionet_data.databases import user_columns

        found = [user_columns.read(lake.files, name, version) for name, version in lake.user_columns.items()]
        rows = [(each.reference, each.type, each.count, each.source, each.created_at) for each in found]
        lines = table(rows, ("column", "type", "scenarios", "from", "at"), max_cell=60) if found else []
        self.say(
            {"user_columns": [asdict(each) | {"reference": each.reference} for each in found]},
            lines or "no user columns; add one: scenarionet db tag LAKE NAME --where ...",
        )
