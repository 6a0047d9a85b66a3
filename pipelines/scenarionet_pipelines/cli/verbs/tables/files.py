"""``scenarionet tables files``: list the Parquet files of a table."""

from __future__ import annotations

from scenarionet_pipelines.cli.verb import SNAPSHOT, LakeVerb, argument


class FilesVerb(LakeVerb):
    """List the Parquet files of a table, for Spark, Polars, pandas or any other engine.

    TABLE is metadata, tracks, lights, maps, shards, quarantine or defects. Read these files rather than the whole
    folder, which may also contain files of unfinished jobs and of older snapshots.
    """

    examples = (
        "scenarionet tables files lake metadata",
        "scenarionet tables files lake tracks --json",
    )
    table: str = argument()
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        paths = self.open().paths(self.table)
        self.say({"table": self.table, "files": paths}, paths)
