"""``scenarionet maintain fsck``: verify the files of a lake."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.output import count, size, table
from scenarionet_pipelines.cli.verb import LakeVerb, Progressing, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from scenarionet_data.maintenance import Fsck

_SHOWN = 20


class FsckVerb(LakeVerb, Progressing):
    """Verify that every file of a lake exists and is intact.

    fsck examines files; `scenarionet maintain check` examines the content of scenarios. In every snapshot, each file
    must exist with its recorded size, footer and number of rows. In the newest snapshot, and in those that databases
    use, every row address, shared map, database member and user column is resolved. Each problem is printed with a
    remedy; the exit code is 1.

    --repair publishes a snapshot without the shards whose files are damaged and deletes those files. Run the
    original `scenarionet convert` again to restore them.

    --upgrade rewrites data files of the newest snapshot and seals all other files of a lake that an older version of
    this software wrote, unless the check finds problems. It can be interrupted and run again, and readers and writers
    can go on; the older version of this software cannot read the lake afterwards.
    """

    examples = (
        "scenarionet maintain fsck lake",
        "scenarionet maintain fsck lake --deep --workers 8 --json",
        "scenarionet maintain fsck lake --deep --repair",
        "scenarionet maintain fsck lake --upgrade",
    )
    deep: bool = option("Read every byte and verify checksums and the scenario ids of all rows.")
    is_repair: bool = option("Remove damaged shards from the lake, so that they can be converted again.", "--repair")
    is_upgrade: bool = option(
        "Check deeply, then seal the files of a lake of an older version, so that every byte of it can be verified.",
        "--upgrade",
    )
    workers: int | None = option("Number of threads. [default: one per core]", type=click.IntRange(1), metavar="N")

    def run(self) -> bool:
        if self.is_upgrade:
            return self.upgrade()
        from scenarionet_data.maintenance import fsck, repair

        with self.progress(f"fsck {self.lake}", "file") as progress:
            found = fsck(self.lake, is_deep=self.deep, workers=self.workers, on_progress=progress.update)
        again = repair(self.lake, found) if self.is_repair and not found.is_whole else []
        lines = [*self.lines(found), *([f"convert again: {', '.join(again[:_SHOWN])}"] if again else [])]
        self.say(asdict(found) | {"is_whole": found.is_whole, "convert_again": again}, lines)
        return found.is_whole

    def upgrade(self) -> bool:
        """Check and upgrade a lake, and print the result; return whether everything is sealed."""
        from scenarionet_data.maintenance import upgrade

        if self.is_repair:
            raise click.UsageError("--upgrade does not repair: run --deep --repair first")
        with self.progress(f"upgrade {self.lake}", "file") as progress:
            done = upgrade(self.lake, workers=self.workers or 1, on_progress=progress.update)
        rows = [("rewritten", count(done.shards, "shard")), ("sealed", count(done.sealed, "other file"))]
        rows += [("failed", f"{name}: {one_line(reason)}") for name, reason in done.failed[:_SHOWN]]
        if done.left:
            kept = f"{count(done.left, 'shard')} that other jobs kept changing: run the same command again"
            rows.append(("left", kept))
        nothing = "nothing was upgraded: repair these problems first"
        lines = table(rows) if done.check.is_whole else [*self.lines(done.check), nothing]
        self.say(asdict(done) | {"is_complete": done.is_complete}, lines)
        return done.is_complete

    def lines(self, found: Fsck) -> Iterator[str]:
        """Yield the problems and what was checked."""
        for problem in found.problems[:_SHOWN]:
            yield f"{problem.file}\n  {one_line(problem.reason)}\n  {problem.remedy.replace('LAKE', self.lake)}"
        if len(found.problems) > _SHOWN:
            yield f"... and {len(found.problems) - _SHOWN:,} more; --json lists them all"
        verdict = "intact" if found.is_whole else count(len(found.problems), "problem")
        files = f"{count(found.num_files, 'file')} of {count(len(found.snapshots), 'snapshot')}"
        rows = [("checked", f"{files}: {verdict}")]
        rows += [("left over", f"{count(n.num_files, 'file')}, {size(n.size)}, {n.text}") for n in found.notes]
        if found.unsealed:
            text = f"{count(len(found.unsealed), 'file')} of an older version, of which not every byte can be verified"
            rows.append(("unsealed", f"{text}: `scenarionet maintain fsck {self.lake} --upgrade` seals them"))
        yield from table(rows)
