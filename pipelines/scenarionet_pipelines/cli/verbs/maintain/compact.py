"""``scenarionet maintain compact``: rewrite small files as fewer, larger ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count, duration, size, table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import Distributed, LakeVerb, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from scenarionet_data.maintenance.bin_packing import Bin
    from scenarionet_data.maintenance.compaction import Compaction


class CompactVerb(LakeVerb, Distributed):
    """Rewrite small files as fewer, larger ones, in one new snapshot.

    training: one scenario per row group and up to 64 per file, as converted; loads random scenarios fastest.
    analytics: 16 scenarios per row group and up to 1,024 per file; files are smaller and SQL over tracks is faster,
    but loading a random scenario takes several times longer.
    archive: as training, in zstd: 13 to 23 % smaller, but loading takes 1.6 to 1.9 times as long.

    Scenarios, ids and databases do not change. Other processes can read and convert at the same time. Files that
    already fit the profile are skipped, and work finished by an interrupted run is reused. The old files remain
    until `scenarionet maintain vacuum` expires the snapshots that refer to them.
    """

    examples = (
        "scenarionet maintain compact lake",
        "scenarionet maintain compact lake --profile analytics --workers 4",
        "scenarionet maintain compact lake --profile archive",
        "scenarionet maintain compact lake --cluster tcp://10.0.0.5:8786",
        "scenarionet maintain compact lake --profile analytics --where dataset=waymo --where 'split=val*' --dry-run",
    )
    profile: str = option("Use to optimise for.", choices=("training", "analytics", "archive"), default="training")
    where: tuple[str, ...] = option("Only matching datasets, versions or splits; repeatable.", metavar="KEY=PATTERN")
    dry_run: bool = option("Print what would be rewritten.")

    def run(self) -> bool:
        from scenarionet_data.maintenance import compact, plan_compaction

        chosen = pairs(self.where, "--where")
        if self.dry_run:
            self.show_plan(plan_compaction(self.lake, self.profile, where=chosen))
            return True
        with self.execution() as execution, self.progress(f"compact {self.lake}", "bin") as progress:

            def kept() -> str:
                return f"{progress.done:,} of {count(progress.total, 'bin')} rewritten and kept"

            with keeping(kept):
                done = compact(
                    self.lake, self.profile, where=chosen, workers=self.num_workers, executor=execution.executor,
                    on_progress=progress.update,
                )  # fmt: skip
        failed = [{"shard": name, "reason": reason} for name, reason in done.failed]
        self.say(asdict(done) | {"failed": failed}, self.lines(done))
        return not (done.failed or done.left)

    def show_plan(self, bins: list[Bin]) -> None:
        """Print what would be rewritten."""
        scenarios, shards = sum(each.num_scenarios for each in bins), sum(len(each.records) for each in bins)
        what = f"{count(scenarios, 'scenario')} of {count(shards, 'shard')}, in {count(len(bins), 'bin')}"
        self.say(
            {"profile": self.profile, "bins": len(bins), "shards": shards, "scenarios": scenarios},
            f"would rewrite {what}" if bins else f"nothing to do: all files fit the profile {self.profile}",
        )

    def lines(self, done: Compaction) -> Iterator[str]:
        """Yield what was rewritten, and what to do next."""
        rows = [
            ("rewritten", f"{count(done.scenarios, 'scenario')} of {count(done.shards, 'shard')} for {done.profile}"),
            ("files", f"{done.files_before:,} before, {done.files_after:,} now"),
            ("bytes", f"{size(done.bytes_before)} before, {size(done.bytes_after)} now"),
        ]
        if done.left:
            rows += [("left", f"{count(done.left, 'shard')} changed by another process in the meantime")]
        rows += [("failed", f"{name} and the rest of its file: {one_line(reason)}") for name, reason in done.failed]
        yield from table([*rows, ("took", duration(done.seconds))] if done.shards or len(rows) > 3 else [])
        if done.failed:
            yield f"Find the damage: scenarionet maintain fsck {self.lake}"
        elif done.shards:
            yield f"Delete the old files: scenarionet maintain vacuum {self.lake} --keep-last 1"
        else:
            yield f"nothing to do: all files fit the profile {done.profile}"
