"""Raw recordings to a lake: plan what is left to do, run the shards, commit what is finished, report.

What runs on a worker is ``jobs.convert_shard``; who runs it (this process, a pool, a cluster) is the caller's
choice of ``executor``.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenarionet_data import converters
from scenarionet_data.conversion.committer import Basket
from scenarionet_data.conversion.jobs import Job, convert_map, convert_shard, lost_shard, run_limited
from scenarionet_data.conversion.plan import Plan, largest_first, make_plan
from scenarionet_data.conversion.remote_raw.downloads import kept_meanwhile
from scenarionet_data.conversion.remote_raw.listing import RawPlace, listing
from scenarionet_data.conversion.report import Report
from scenarionet_data.conversion.selection import Choice, Selection
from scenarionet_data.converters.base import Converter
from scenarionet_data.converters.splits import guess_split
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.ingest.shard import Options, Shard
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.opening import open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots

_WORD = re.compile(r"[A-Za-z0-9._-]+")


@kept_meanwhile()
def convert(
    dataset: str,
    raw: str,
    lake: str | Path,
    *,
    split: str | None = None,
    version: str | None = None,
    options: Options | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    limit: int | None = None,
    selection: Choice | None = None,
    replace_old: bool = False,
    stale: bool = False,
    is_checked: bool = True,
    on_progress: Progress | None = None,
) -> Report:
    """Convert raw recordings into a lake; finished shards of earlier runs are kept, never redone.

    Args:
        dataset: Name of a converter.
        raw: The raw recordings: a folder, its URL in an object store, or what the converter says.
        lake: The lake's folder or URL; made when it is not there.
        split: The owner's split; guessed from the folder's name unless given.
        version: The dataset's release; the converter's default unless given.
        options: The converter's options.
        workers: Processes.
        executor: Runs the shards instead of the processes, for example on a cluster.
        limit: Stop after that many scenarios, for a quick look.
        selection: Which of the recordings; all unless given.
        replace_old: Replace shards converted with other options, from changed files, or by another version.
        stale: Replace shards converted by another converter version.
        is_checked: Ask the hard rules of ``sql/checks`` before anything is written; what breaks one goes to quarantine.
        on_progress: Told when shards are about to be converted, and about every finished one.

    Raises:
        SourceNotFound: Nothing of this dataset at ``raw``.
        BadParameter: The selection leaves nothing, or asks for what is not known before reading.
        DuplicateScenario: The recordings are in the lake already, converted with other options.
        BrokenContract: A map that scenarios share breaks a hard rule.
        LakeError: The lake cannot be written.
    """
    started = time.monotonic()
    converter = converters.get(dataset)
    files, maps, plan = _prepare(
        converter,
        raw,
        lake,
        split,
        version,
        options,
        selection or Selection(),
        replace_old=replace_old,
        stale=stale,
        order=largest_first if limit is None else None,
    )
    files.sweep()
    report = Report(skipped=plan.num_skipped, stale=plan.num_stale)
    map_jobs = [Job(dataset, shard, str(files.root), is_checked=is_checked) for shard in maps.shards]
    _convert_maps(files, map_jobs, maps, report)
    jobs = [Job(dataset, shard, str(files.root), limit, is_checked) for shard in plan.shards]
    executor = executor or executor_for(min(workers, len(jobs)))
    outcomes = executor(jobs, convert_shard, lost_shard) if limit is None else run_limited(jobs, limit)
    basket = Basket(files, plan, f"convert {dataset}", report)
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
    selection: Choice | None = None,
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
    selection: Choice,
    *,
    replace_old: bool,
    stale: bool,
    order: Callable[[Iterable[Shard]], list[Shard]] | None = None,
) -> tuple[LakeFiles, Plan, Plan]:
    """The lake's files, what to do about shared maps, and what to do about scenarios, in an order of its own if given.

    Shards are ordered where they are listed: what is in an object store has its sizes there.
    """
    files, chosen, version = open_files(lake), options or converter.Options(), version or converter.release
    held = manifests.shards(files, snapshots.read(files))
    with listing(converter, raw, chosen) as place:
        split = split or guess_split(place.folder, place.top)
        for name, value in (("split", split), ("version", version)):
            if not _WORD.fullmatch(value):
                raise BadParameter(f"--{name} {value!r}: use letters, digits, '.', '_' and '-'")
        chosen_shards = selection.of(converter.shards(place.folder, split, version, chosen))
        maps, scenarios = (
            make_plan(wanted, held, converter.version, replace_old=replace_old, stale=stale)
            for wanted in (converter.maps(place.folder, version, chosen), chosen_shards)
        )
        if order:
            scenarios = replace(scenarios, shards=tuple(order(scenarios.shards)))
        return files, _placed(maps, place), _placed(scenarios, place)


def _placed(plan: Plan, place: RawPlace) -> Plan:
    return replace(plan, shards=tuple(map(place.place, plan.shards)))


def _convert_maps(files: LakeFiles, jobs: list[Job], plan: Plan, report: Report) -> None:
    """Shared maps come first: a scenario in the lake always finds its map."""
    basket = Basket(files, plan, "convert maps", report)
    for job in jobs:
        basket.add(convert_map(job))
    basket.commit()
