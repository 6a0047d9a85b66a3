"""Raw recordings to a lake: plan what is left to do, run the shards, commit what is finished, report.

What runs on a worker is ``jobs.convert_shard``; who runs it (this process, a pool, a cluster) is the caller's
choice of ``run``.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenarionet_data import converters
from scenarionet_data.converters.base import Converter, Options, guess_split
from scenarionet_data.errors import BadParameter
from scenarionet_data.jobs import Job, Outcome, Run, convert_map, run_limited, runner
from scenarionet_data.plan import Plan, make_plan
from scenarionet_data.selection import Selection
from scenarionet_data.store import commit as commits
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.shard_record import ShardRecord

_COMMIT_EVERY = 30.0
_WORD = re.compile(r"[A-Za-z0-9._-]+")


@dataclass
class Report:
    """What a conversion did.

    Attributes:
        converted: Scenarios written.
        quarantined: Scenarios rejected.
        shards: Shards converted.
        adopted: Shards that an earlier, interrupted job had finished.
        skipped: Shards that were in the lake already.
        replaced: Shards whose scenarios were taken out for newer ones.
        stale: Shards in the lake that another converter version wrote, and that stay.
        partitions: Where the scenarios went: dataset, version, split.
        failed: Shard name and reason.
        seconds: Time it took.
        snapshot: The lake's newest snapshot.
        size: Bytes written.
    """

    converted: int = 0
    quarantined: int = 0
    shards: int = 0
    adopted: int = 0
    skipped: int = 0
    replaced: int = 0
    stale: int = 0
    partitions: set[tuple[str, str, str]] = field(default_factory=set)
    failed: list[tuple[str, str]] = field(default_factory=list)
    seconds: float = 0.0
    snapshot: int = 0
    size: int = 0

    @property
    def is_clean(self) -> bool:
        """Whether nothing failed and nothing was quarantined."""
        return not self.failed and not self.quarantined


Progress = Callable[[int, int, int], None]
"""Called with shards done, shards to do, scenarios converted."""


def convert(
    dataset: str,
    raw: str,
    lake: str | Path,
    *,
    split: str | None = None,
    version: str | None = None,
    options: Options | None = None,
    workers: int = 1,
    run: Run | None = None,
    limit: int | None = None,
    selection: Selection | None = None,
    replace_old: bool = False,
    stale: bool = False,
    on_progress: Progress | None = None,
) -> Report:
    """Convert raw recordings into a lake; finished shards of earlier runs are kept, never redone.

    Args:
        dataset: Name of a converter.
        raw: The raw recordings: a folder, or what the converter says.
        lake: The lake's folder; made when it is not there.
        split: The owner's split; guessed from the folder's name unless given.
        version: The dataset's release; the converter's default unless given.
        options: The converter's options.
        workers: Processes.
        run: Runs jobs in place of the processes, for example on a cluster.
        limit: Stop after that many scenarios, for a quick look.
        selection: Which of the recordings; all unless given.
        replace_old: Replace shards converted with other options, from changed files, or by another version.
        stale: Replace shards converted by another converter version.
        on_progress: Told when shards are about to be converted, and about every finished one.

    Raises:
        SourceNotFound: Nothing of this dataset at ``raw``.
        BadParameter: The selection leaves nothing, or asks for what is not known before reading.
        DuplicateScenario: The recordings are in the lake already, converted with other options.
        LakeError: The lake cannot be written.
    """
    started = time.monotonic()
    converter = converters.get(dataset)
    files, maps, plan = _prepare(
        converter, raw, lake, split, version, options, selection or Selection(), replace_old=replace_old, stale=stale
    )
    files.sweep()
    report = Report(skipped=plan.num_skipped, stale=plan.num_stale)
    _convert_maps(files, [Job(dataset, shard, str(files.root)) for shard in maps.shards], maps, report)
    jobs = [Job(dataset, shard, str(files.root), limit) for shard in plan.shards]
    outcomes = run_limited(jobs, limit) if limit is not None else (run or runner(min(workers, len(jobs))))(jobs)
    basket = _Basket(files, plan, f"convert {dataset}", report)
    if on_progress:
        on_progress(0, len(jobs), 0)
    try:
        for done, outcome in enumerate(outcomes, start=1):
            basket.add(outcome)
            if on_progress:
                on_progress(done, len(jobs), report.converted)
    finally:
        basket.commit()
    report.snapshot = commits.consolidate(files).number
    report.seconds = time.monotonic() - started
    return report


def plan_conversion(
    dataset: str,
    raw: str,
    lake: str | Path,
    *,
    split: str | None = None,
    version: str | None = None,
    options: Options | None = None,
    selection: Selection | None = None,
    replace_old: bool = False,
    stale: bool = False,
) -> Plan:
    """What :func:`convert` would do with the same arguments; nothing is read but names, nothing is written.

    Raises:
        SourceNotFound: Nothing of this dataset at ``raw``.
        BadParameter: The selection leaves nothing, or asks for what is not known before reading.
        DuplicateScenario: The recordings are in the lake already, converted with other options.
    """
    converter = converters.get(dataset)
    return _prepare(
        converter, raw, lake, split, version, options, selection or Selection(), replace_old=replace_old, stale=stale
    )[2]


def _prepare(
    converter: Converter[Any],
    raw: str,
    lake: str | Path,
    split: str | None,
    version: str | None,
    options: Options | None,
    selection: Selection,
    *,
    replace_old: bool,
    stale: bool,
) -> tuple[LakeFiles, Plan, Plan]:
    """The lake's files, what to do about shared maps, and what to do about scenarios."""
    split, version = split or guess_split(raw), version or converter.release
    for name, value in (("split", split), ("version", version)):
        if not _WORD.fullmatch(value):
            raise BadParameter(f"--{name} {value!r}: use letters, digits, '.', '_' and '-'")
    files, chosen = LakeFiles(lake), options or converter.Options()
    held = snapshots.shards(files, snapshots.read(files))
    chosen_shards = selection.of(converter.shards(raw, split, version, chosen))
    maps, scenarios = (
        make_plan(wanted, held, converter.version, replace_old=replace_old, stale=stale)
        for wanted in (converter.maps(raw, version, chosen), chosen_shards)
    )
    return files, maps, scenarios


def _convert_maps(files: LakeFiles, jobs: list[Job], plan: Plan, report: Report) -> None:
    """Shared maps come first: a scenario in the lake always finds its map."""
    basket = _Basket(files, plan, "convert maps", report)
    for job in jobs:
        basket.add(convert_map(job))
    basket.commit()


# --- commit and count -------------------------------------------------------------------------------------


class _Basket:
    """Finished shards on their way into the lake, and the report on them."""

    def __init__(self, files: LakeFiles, plan: Plan, operation: str, report: Report) -> None:
        self._files = files
        self._plan = plan
        self._operation = operation
        self._report = report
        self._finished: list[ShardRecord] = []
        self._committed_at = time.monotonic()

    def add(self, outcome: Outcome) -> None:
        """Count an outcome; commit now and then, so that a killed job loses little."""
        report, record = self._report, outcome.record
        if record is None:
            report.failed.append((outcome.shard, outcome.error or "unknown"))
            return
        report.converted += record.num_scenarios
        report.quarantined += record.num_quarantined
        report.size += sum(record.sizes)
        report.shards += 1
        report.adopted += outcome.was_finished
        if record.num_scenarios or record.num_quarantined:  # a shared map has no split
            report.partitions.add((record.dataset, record.version, record.split))
        self._finished.append(record)
        if time.monotonic() - self._committed_at > _COMMIT_EVERY and not self._plan.replaced:
            self.commit()

    def commit(self) -> None:
        """Commit what is finished and may be, and report what may not."""
        finished = self._finished
        while True:
            ready, gone = self._plan.settle(finished)
            refused = commits.commit(self._files, ready, self._operation, gone).refused
            for record, scenario_id in refused:
                self._leave_out(record, _duplicate_message(scenario_id))
            if not (refused and gone):
                break
            # Nothing was committed: without what was refused, others may have to wait.
            keys = {record.key for record, _ in refused}
            finished = [record for record in finished if record.key not in keys]
        settled = {record.key for record in ready}
        for record in finished:
            if record.key not in settled:
                self._leave_out(record, _WAITS)
        self._report.replaced += len(gone)
        self._finished = []
        self._committed_at = time.monotonic()

    def _leave_out(self, record: ShardRecord, reason: str) -> None:
        self._report.failed.append((record.name, reason))
        self._report.converted -= record.num_scenarios
        self._report.shards -= 1


_WAITS = (
    "it would replace scenarios together with shards that failed; mend those and run the same command again: "
    "it is finished and will be adopted"
)


def _duplicate_message(scenario_id: str) -> str:
    """What to do about a scenario that is in the lake already."""
    return (
        f"scenario {scenario_id} is in the lake already, from another source or split; "
        "give these recordings a --version of their own, or --replace the old ones"
    )
