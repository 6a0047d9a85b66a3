"""``scenarionet pack``: write a database with its scenarios as a portable lake."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.output import count, size, table
from scenarionet_pipelines.cli.verb import Choosing, Progressing, argument, option
from scenarionet_pipelines.messages import one_line


class PackVerb(Choosing, Progressing):
    """Write a database and everything its scenarios need to OUT, a self-contained lake.

    OUT can be moved anywhere and is read by every verb and by the loader, also from read-only media. It contains the
    scenarios, the tiles of shared maps that they use, and user columns, but no quarantined scenarios.
    With --order-by and --limit, the first scenarios are saved as a database, and packed.
    OUT/SHA256SUMS lists every file for `sha256sum -c`, OUT/README.md is a card for Hugging Face with the tables as
    configurations of `datasets.load_dataset(OUT)`.

    --verify reads every byte and verifies checksums, row counts and references (exit code 1 if something is wrong).
    """

    examples = (
        "scenarionet pack lake busy busy_pack",
        "scenarionet pack lake busy_val busy_val.tar --tar",
        "scenarionet pack lake busy hardest --order-by 'difficulty DESC' --limit 20",
        "scenarionet pack --verify busy_pack",
    )
    words: tuple[str, ...] = argument("LAKE DATABASE OUT", required=False)
    tar: bool = option("Write a single tar file; it has to be unpacked before use.")
    publishable: bool = option("Refuse scenarios whose licence is not known to allow redistribution.")
    pack: str | None = option("Verify a pack (folder or tar file) instead of writing one.", "--verify", metavar="PATH")

    def run(self) -> bool:
        if self.pack is not None:
            if self.words or self.tar or self.publishable or self.order_by or self.limit:
                raise click.UsageError("--verify PATH takes no other arguments")
            return self.verify(self.pack)
        if len(self.words) != 3:
            raise click.UsageError("expected LAKE DATABASE OUT, or --verify PATH")
        from scenarionet_data import Lake

        self.lake, database, out = self.words
        with self.progress(f"pack {database}", "step") as progress:
            done = Lake(self.lake).pack(
                self.saved(database), out, tar=self.tar, publishable=self.publishable, on_progress=progress.update
            )
        content = f"{count(done.num_scenarios, 'scenario')}, {count(done.num_files, 'file')}"
        self.say(asdict(done), f"{done.path}: {done.reference}, {content}, {size(done.num_bytes)}")
        return True

    def verify(self, path: str) -> bool:
        """Verify a pack; return whether it is whole."""
        from scenarionet_data.packs.verifying import verify_pack

        with self.progress(f"verify {path}", "file") as progress:
            found = verify_pack(path, progress.update)
        verdict = "intact" if found.is_whole else count(len(found.damages), "file") + " broken"
        whole = f"{path}: {', '.join(found.references)}, {count(found.num_files, 'file')}: {verdict}"
        damages = table((damage.file, one_line(damage.reason)) for damage in found.damages)
        self.say(asdict(found) | {"is_whole": found.is_whole}, [*damages, whole])
        return found.is_whole
