"""Raw recordings to a lake: plan what is left to do, run the shards, commit what is finished, report.

What runs on a worker is :func:`convert_shard`; who runs it (this process, a pool, a cluster) is the caller's
choice of ``run``.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from scenarionet_data import converters
from scenarionet_data.converters.base import Converter, Options, Shard, guess_split
from scenarionet_data.errors import BadParameter, LakeError, SourceError, WorkerLost
from scenarionet_data.plan import Plan, make_plan
from scenarionet_data.selection import Selection
from scenarionet_data.store import commit as commits
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.shard_writer import ShardRecord, ShardWriter, find_finished
from scenarionet_data.store.shared_map import write_shared_map
from scenarionet_data.worker import follow_parent

_COMMIT_EVERY = 30.0
_WORD = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True)
class Job:
    """A shard to convert, with all a worker needs; picklable.

    Attributes:
        converter: Name of the converter.
        shard: What to convert.
        lake: The lake's root.
        max_scenarios: Stop after that many.
    """

    converter: str
    shard: Shard
    lake: str
    max_scenarios: int | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of a shard.

    Attributes:
        shard: Its name.
        record: The finished shard; None when it failed.
        error: Why it failed.
        was_finished: An earlier job had finished it already.
        seconds: Time it took.
    """

    shard: str
    record: ShardRecord | None
    error: str | None = None
    was_finished: bool = False
    seconds: float = 0.0


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


Run = Callable[[Iterable[Job]], Iterator[Outcome]]
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
    outcomes = _run_limited(jobs, limit) if limit is not None else (run or _runner(min(workers, len(jobs))))(jobs)
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
        basket.add(_convert_map(job))
    basket.commit()


def _convert_map(job: Job) -> Outcome:
    """Convert one shared map."""
    converter, shard = converters.get(job.converter), job.shard
    try:
        features = converter.map_features(shard)
    except SourceError as error:
        return Outcome(shard.name, None, error=str(error))
    record = write_shared_map(LakeFiles(job.lake), shard, features, converter.version, converter.licence)
    return Outcome(shard.name, record)


def convert_shard(job: Job) -> Outcome:
    """Convert one shard, or adopt it when an earlier job finished it. Runs on a worker.

    A record that cannot become a scenario goes to quarantine and the shard goes on; a shard that cannot be
    read fails alone.

    Raises:
        LakeError: The lake cannot be written; no other shard could be either.
    """
    started = time.monotonic()
    converter, files, shard = converters.get(job.converter), LakeFiles(job.lake), job.shard
    if job.max_scenarios is None:
        finished = find_finished(files, shard, converter.version)
        if finished:
            return Outcome(shard.name, finished, was_finished=True)
    else:
        shard = replace(shard, name=f"{shard.name}-first{job.max_scenarios}")
    writer = ShardWriter(files, shard, converter.version, converter.licence)
    try:
        _write_scenarios(converter, shard, writer, job.max_scenarios)
        record = writer.finish(job.max_scenarios)
    except (LakeError, MemoryError):
        raise
    except SourceError as error:
        return Outcome(shard.name, None, error=str(error), seconds=time.monotonic() - started)
    except Exception as error:  # a converter's own fault with one file must not end the run
        message = f"{type(error).__name__}: {error} (while reading {shard.root})"
        return Outcome(shard.name, None, error=message, seconds=time.monotonic() - started)
    finally:
        writer.abandon()
    return Outcome(shard.name, record, seconds=time.monotonic() - started)


def _write_scenarios(converter: Converter[Any], shard: Shard, writer: ShardWriter, max_scenarios: int | None) -> None:
    for position, record in enumerate(converter.records(shard)):
        if writer.num_scenarios == max_scenarios:
            return
        try:
            writer.add(converter.scenario(shard, record))
        except (MemoryError, LakeError, SourceError):
            raise
        except Exception as error:  # whatever a damaged record provokes, the rest must go on
            writer.reject(position, error)


# --- who runs the jobs ----------------------------------------------------------------------------------


def _runner(workers: int) -> Run:
    return _run_here if workers <= 1 else lambda jobs: _run_pool(jobs, workers)


def _run_here(jobs: Iterable[Job]) -> Iterator[Outcome]:
    return (convert_shard(job) for job in jobs)


def _run_limited(jobs: Iterable[Job], limit: int) -> Iterator[Outcome]:
    """One shard after the other until ``limit`` scenarios are converted."""
    left = limit
    for job in jobs:
        if left <= 0:
            return
        outcome = convert_shard(replace(job, max_scenarios=left))
        left -= outcome.record.num_scenarios if outcome.record else 0
        yield outcome


def _run_pool(jobs: Iterable[Job], workers: int) -> Iterator[Outcome]:
    """A pool of processes with two jobs each in flight; outcomes as they come."""
    queue = iter(jobs)
    # spawn: a forked child would share the locks of Arrow's and DuckDB's threads.
    with ProcessPoolExecutor(workers, get_context("spawn"), follow_parent) as pool:
        running: set[Future[Outcome]] = set()
        try:
            while True:
                for job in queue:
                    running.add(pool.submit(convert_shard, job))
                    if len(running) >= 2 * workers:
                        break
                if not running:
                    return
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        except BrokenProcessPool as error:
            raise WorkerLost(
                "a worker process was killed, most often for memory; run the same command again, with fewer "
                "--workers: finished shards are kept"
            ) from error
        finally:
            for future in running:
                future.cancel()


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
