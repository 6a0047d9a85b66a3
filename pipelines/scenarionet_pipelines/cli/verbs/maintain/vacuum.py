"""``scenarionet maintain vacuum``: expire old snapshots and delete the files only they use."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.output import count, size, table
from scenarionet_pipelines.cli.parameters import seconds
from scenarionet_pipelines.cli.verb import LakeVerb, Progressing, option

_MAX_LISTED = 8


class VacuumVerb(LakeVerb, Progressing):
    """Expire old snapshots and delete the files that only they use.

    Without --yes, nothing is deleted. With both --keep-last and --older-than, a snapshot expires only if neither
    keeps it. The newest snapshot never expires, nor does one that a database uses: drop or rebase that database
    first. Databases, user columns and simulation results are not deleted.

    Other processes can convert and read at the same time: files younger than a day are never deleted. A reader of an
    expired snapshot gets an error that asks to open the lake again.
    """

    examples = (
        "scenarionet maintain vacuum lake --keep-last 1",
        "scenarionet maintain vacuum lake --older-than 30d --yes",
        "scenarionet maintain vacuum lake --keep-last 10 --older-than 7d --json",
    )
    keep_last: int | None = option("Keep the N newest snapshots.", type=click.IntRange(1), metavar="N")
    older_than: str | None = option("Keep snapshots younger than this: 30d, 12h, 2w, 90min.", metavar="TIME")
    dry_run: bool = option("Print what would be deleted (the default without --yes).")
    yes: bool = option("Delete.")

    def run(self) -> None:
        from scenarionet_data.maintenance import plan_vacuum, vacuum

        if self.keep_last is None and self.older_than is None:
            raise click.UsageError("choose the snapshots to expire: --keep-last N, --older-than 30d, or both")
        if self.yes and self.dry_run:
            raise click.UsageError("--dry-run and --yes contradict each other")
        age = None if self.older_than is None else seconds(self.older_than, "--older-than", allow_zero=True)
        if self.yes:
            with self.progress(f"vacuum {self.lake}", "file") as progress:
                done = vacuum(self.lake, keep_last=self.keep_last, older_than=age, on_progress=progress.update)
        else:
            done = plan_vacuum(self.lake, keep_last=self.keep_last, older_than=age)
        young = sum(listed.size for listed in done.young)
        content = {"is_done": done.is_done, "expired": done.expired, "kept": done.kept, "needed": done.needed}
        tables = {name: {"files": number, "bytes": held} for name, (number, held) in done.tables.items()}
        content |= {"files": [listed.name for listed in done.files], "bytes": done.size, "tables": tables}
        content |= {"young": {"files": len(done.young), "bytes": young}}
        would = "" if done.is_done else "would "
        rows = [(would + ("expire" if would else "expired"), numbered(done.expired)), ("kept", numbered(done.kept))]
        rows += [
            ("needed", f"snapshot {n} by {', '.join(names)}; rebase it and drop that version")
            for n, names in done.needed.items()
        ]
        rows += [
            (would + ("delete" if would else "deleted"), f"{count(number, 'file')} of {name}, {size(held)}")
            for name, (number, held) in done.tables.items()
        ]
        if done.young:
            rows += [("left", f"{count(len(done.young), 'file')}, {size(young)}: unused, but younger than a day")]
        left = f"add --yes to delete; frees {size(done.size)}" if done.expired or done.files else "nothing to do"
        self.say(content, [*table(rows), f"freed {size(done.size)}" if done.is_done else left])


def numbered(snapshots: tuple[int, ...]) -> str:
    """Return how many snapshots these are, with the first numbers."""
    shown = ", ".join(map(str, snapshots[:_MAX_LISTED])) + (", ..." if len(snapshots) > _MAX_LISTED else "")
    return count(len(snapshots), "snapshot") + (f": {shown}" if snapshots else "")
