"""``scenarionet db diff``: compare two databases, or two snapshots of the lake."""

from __future__ import annotations

from scenarionet_pipelines.cli.databases import diff_as_json, print_diff
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.verb import LakeVerb, argument


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
        from scenarionet_data import Lake

        diff = Lake(self.lake).diff(self.old, self.new)
        if self.as_json:
            print_json(diff_as_json(diff))
        else:
            print_diff(diff)
