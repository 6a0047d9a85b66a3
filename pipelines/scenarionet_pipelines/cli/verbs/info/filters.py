"""``scenarionet info filters``: list the named filters and the columns of conditions."""

from __future__ import annotations

from scenarionet_pipelines.cli.named import show_named
from scenarionet_pipelines.cli.verb import Verb, option


class FiltersVerb(Verb):
    """List the named filters, or the columns that conditions can use."""

    examples = (
        "scenarionet info filters",
        "scenarionet info filters --columns",
    )
    columns: bool = option("List the columns of metadata instead, with units and descriptions.")

    def run(self) -> None:
        if not self.columns:
            from scenarionet_data.query.named_sql import FILTERS

            show_named(FILTERS, "filters", self.as_json)
            return
        from scenarionet_data.schema import tables
        from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS

        metadata = tables.load("metadata")
        columns = [c for c in (*metadata.columns, *metadata.derived) if c.name not in ADDRESS_COLUMNS]
        self.say(
            {"columns": [{"name": c.name, "type": c.type, "unit": c.unit, "doc": c.doc} for c in columns]},
            [f"{c.name}{f' [{c.unit}]' if c.unit else ''}\n    {c.doc}" for c in columns],
        )
