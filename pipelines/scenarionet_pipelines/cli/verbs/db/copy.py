"""``scenarionet db copy``: save a database under another name."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.verb import NEW_VERSION, DatabaseVerb, argument


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
        from scenarionet_data import Lake

        print_created(Lake(self.lake).copy(self.database, name=self.name, replace=self.replace), self.as_json)
