"""Upgrade a lake of an older version of this software, so that every byte of it can be verified.

Data files of the newest snapshot are rewritten, because their pages need checksums and the manifest states their sizes.
The other files without a seal are sealed and replaced one by one, atomically: metadata, manifests, snapshots,
databases, user columns and evaluation results. Data files that only older snapshots refer to stay as they are: their
checksums are in the manifests. The checksums of a pack are written again.

Readers and writers may work on. A killed upgrade continues where it was when it is run again.
"""

from __future__ import annotations

import shutil
import time
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field

from scenarionet_data.execution.executors import executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.maintenance.bin_packing import Bin
from scenarionet_data.maintenance.compaction import ROUNDS, rewrite_bins
from scenarionet_data.maintenance.fsck import Fsck, fsck
from scenarionet_data.packs.contents import SUMS, renew_sums
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.write import layouts
from scenarionet_data.storage.write.relocation import copy_sealed


@dataclass
class Upgrade:
    """Result of an upgrade.

    Attributes:
        check: Result of the deep check before; nothing is changed if it found problems.
        shards: Number of shards whose data files were rewritten.
        sealed: Number of other files that were sealed.
        failed: Name of the first shard of each group that could not be rewritten, and the reason.
        left: Number of shards skipped because other jobs kept changing them; run again for these.
        snapshot: Number of the lake's newest snapshot.
        seconds: Time taken.
    """

    check: Fsck
    shards: int = 0
    sealed: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    left: int = 0
    snapshot: int = 0
    seconds: float = 0.0

    @property
    def is_complete(self) -> bool:
        """Whether every byte of the lake can be verified now."""
        return self.check.is_whole and not self.failed and not self.left


def upgrade(lake: LakeFilesLike, *, workers: int = 1, on_progress: Progress | None = None) -> Upgrade:
    """Check a lake deeply, then seal all of its files that are not sealed yet.

    Args:
        lake: The lake, its folder or its URL.
        workers: Number of processes that rewrite data files.
        on_progress: Called during each of three steps: the check, rewriting, sealing.

    Raises:
        NoSuchSnapshot: Not a lake.
        LakeError: The lake cannot be written.
    """
    started, files = time.monotonic(), open_files(lake)
    report = Upgrade(fsck(lake, is_deep=True, on_progress=on_progress))
    if report.check.is_whole:
        files.sweep()
        for _ in range(ROUNDS):
            bins = list(_unsealed_bins(files))
            executor = executor_for(workers, len(bins))
            done, late, failed = rewrite_bins(files, bins, executor, "upgrade", on_progress)
            report.shards += sum(len(each.old) for each in done)
            report.left = sum(len(each.old) for each in late)
            report.failed = [(result.bin.records[0].name, str(result.error)) for result in failed]
            if not report.left:
                break
        _seal_others(files, report, on_progress)
        if files.has(SUMS):
            renew_sums(files)
    report.snapshot = snapshots.read(files).number
    report.seconds = time.monotonic() - started
    return report


# --- data files -------------------------------------------------------------------------------------------


def _unsealed_bins(files: LakeFiles) -> Iterable[Bin]:
    """Shards of the newest snapshot with unsealed data files, together with those that share these."""
    units: dict[tuple[str, str, str, str], list[ShardRecord]] = defaultdict(list)
    for record in manifests.shards(files, snapshots.read(files)):
        units[record.dataset, record.version, record.split, layouts.unit_of(record)].append(record)
    for records in units.values():
        names = {name for record in records for name in record.files if name.split("/")[0] in tables.LOADED}
        if any(not files.end(name).digest for name in sorted(names)):
            yield Bin(str(files.root), layouts.layout_of(records[0]).name, tuple(records))


# --- other files ------------------------------------------------------------------------------------------


def _seal_others(files: LakeFiles, report: Upgrade, on_progress: Progress | None) -> None:
    """Replace the unsealed files that were found by the check, except data files, each by itself with a seal."""
    names = [name for name in report.check.unsealed if name.split("/")[0] not in tables.LOADED]
    for done, name in enumerate(names, start=1):
        if files.has(name):  # otherwise a vacuum has deleted it in the meantime
            source, temporary = files.path(name), files.temporary()
            with writing(temporary, temporary):
                if name.endswith(".json"):
                    content, _ = seals.read_json(source.read_bytes(), files.place(name))
                    temporary.write_bytes(seals.seal_json(content, files.place_to_write(name)))
                else:
                    copy_sealed(files, name, temporary, files.place_to_write(name))
                shutil.copystat(source, temporary)  # the age of a snapshot is the time of its publication
            files.publish(temporary, name)
            snapshots.remove_expired(files, name)
            report.sealed += 1
        if on_progress:
            on_progress(done, len(names), 0)
