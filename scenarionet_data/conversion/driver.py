"""Convert raw recordings into a lake: plan what is missing, run the shards, commit finished ones, report.

Workers run :func:`~scenarionet_data.conversion.jobs.convert_shard`; the ``executor`` decides where: in this process,
in a pool of processes or on a cluster.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace as replaced
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from scenarionet_data import converters
from scenarionet_data.conversion.committer import Committer, ConversionReport
from scenarionet_data.conversion.jobs import ShardJob, convert_map, convert_shard, lost_shard, run_limited
from scenarionet_data.conversion.plan import ConversionPlan, ShardFilter, largest_first, make_plan
from scenarionet_data.conversion.remote_raw.downloads import remove_downloads
from scenarionet_data.conversion.remote_raw.mirror import mirrored
from scenarionet_data.converters.splits import guess_split, lake_spelling, split_folder
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor, executor_for
from scenarionet_data.execution.progress import Progress
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.places import LakeFilesLike, is_url, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots

_WORD = re.compile(r"[A-Za-z0-9._-]+")


def convert(
    dataset: str,
    raw: str | Path,
    lake: LakeFilesLike,
    *,
    split: str | None = None,
    version: str | None = None,
    options: Options | Mapping[str, Any] | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    limit: int | None = None,
    selection: ShardFilter | None = None,
    replace: bool = False,
    reconvert_stale: bool = False,
    check: bool = True,
    on_progress: Progress | None = None,
) -> ConversionReport:
    """Convert raw recordings into a lake; shards that an earlier run finished are kept and not converted again.

    Args:
        dataset: Name of a converter, or ``module:Class``.
        raw: The raw recordings: a folder, its URL in an object store, or another form that the converter documents.
        lake: The lake, its folder or its URL; created if missing.
        split: The dataset's split, as in the lake (``val``) or as in the dataset's folders (``validation``); guessed
            from the folder's name by default.
        version: The dataset's release; by default the converter's.
        options: The converter's options: an ``Options`` object or a mapping, for example ``{"density": 15}``.
        workers: Number of processes.
        executor: Runs the shards instead of local processes, for example on a cluster.
        limit: Stop after this many scenarios, for a quick look.
        selection: Which recordings to convert; all by default.
        replace: Replace shards converted with other options, from changed files or by another converter version.
        reconvert_stale: Replace shards converted by another converter version.
        check: Apply the hard rules of ``sql/checks`` before writing; violations go to quarantine. What cannot be stored
            (NaN, sizes of 0, ...) is dropped or quarantined in any case.
        on_progress: Called before the first shard and after each one.

    Raises:
        SourceNotFound: ``raw`` has no recordings of this dataset.
        BadParameter: The selection matches nothing or uses an unknown property; an option is unknown or has a value
            of the wrong type.
        DuplicateScenario: The recordings are in the lake already, converted with other options.
        BrokenContract: A shared map breaks a hard rule.
        LakeError: The lake cannot be written.
    """
    for name, number in (("workers", workers), ("limit", limit)):
        if number is not None and (not isinstance(number, int) or number < 1):
            raise BadParameter(f"{name}: wanted 1 or more, found {number!r}")
    for name, text in (("dataset", dataset), ("split", split), ("version", version)):
        if not isinstance(text, str | None):
            raise BadParameter(f"{name}: wanted a text, found {text!r}")
    started, raw = time.monotonic(), str(raw)
    try:
        wanted = _Wanted(dataset, raw, lake, split, version, options, selection, replace, reconvert_stale)
        files, maps, plan = _plan(wanted, sort=limit is None)
        files.sweep()
        report = ConversionReport(skipped=plan.num_skipped, stale=plan.num_stale, passed_over=plan.passed_over)
        if maps.shards:  # shared maps first: a scenario in the lake always finds its map
            committer = Committer(files, maps, "convert maps", report, started)
            for shard in maps.shards:
                committer.add(convert_map(ShardJob(dataset, shard, str(files.root), check=check)))
            committer.commit()
        jobs = [ShardJob(dataset, shard, str(files.root), limit, check) for shard in plan.shards]
        if limit is None:
            executor = executor or executor_for(workers, len(jobs))
            results = executor(jobs, convert_shard, lost_shard)
        else:
            results = run_limited(jobs, limit)
        committer = Committer(files, plan, f"convert {dataset}", report, started)
        return committer.add_all(results, len(jobs), on_progress)
    finally:
        if is_url(raw):
            remove_downloads()


def plan_conversion(
    dataset: str,
    raw: str | Path,
    lake: LakeFilesLike,
    *,
    split: str | None = None,
    version: str | None = None,
    options: Options | Mapping[str, Any] | None = None,
    selection: ShardFilter | None = None,
    replace: bool = False,
    reconvert_stale: bool = False,
) -> ConversionPlan:
    """Return what :func:`convert` would do with the same arguments; lists files and writes nothing.

    Raises:
        SourceNotFound: ``raw`` has no recordings of this dataset.
        BadParameter: The selection matches nothing or uses an unknown property; an option is unknown or has a value
            of the wrong type.
        DuplicateScenario: The recordings are in the lake already, converted with other options.
    """
    wanted = _Wanted(dataset, str(raw), lake, split, version, options, selection, replace, reconvert_stale)
    return _plan(wanted, sort=False)[2]


class _Wanted(NamedTuple):
    """What to convert: arguments of :func:`convert` and :func:`plan_conversion`."""

    dataset: str
    raw: str
    lake: LakeFilesLike
    split: str | None
    version: str | None
    options: Options | Mapping[str, Any] | None
    selection: ShardFilter | None
    replace: bool
    reconvert_stale: bool


def _plan(wanted: _Wanted, *, sort: bool) -> tuple[LakeFiles, ConversionPlan, ConversionPlan]:
    """Return the lake's files and the plans for shared maps and scenarios, largest shards first if ``sort``."""
    converter, files, raw, options = converters.get(wanted.dataset), open_files(wanted.lake), wanted.raw, wanted.options
    if not isinstance(options, Options):
        options = converter.Options.from_mapping(options or {})
    for name, path in options.paths.items():
        if is_url(path):
            raise BadParameter(
                f"option {name!r}: {path} is not a folder on this machine; give one, or leave {name} out: files below "
                "RAW in an object store are found there"
            )
    existing = manifests.shards(files, snapshots.read(files))
    raw = urlsplit(raw).path if urlsplit(raw).scheme == "file" else raw
    with mirrored(converter, raw) if is_url(raw) else nullcontext() as mirror:
        folder, top = (mirror.folder, mirror.top) if mirror else (raw, "")
        version = wanted.version or converter.release
        is_guessed, split = not wanted.split, wanted.split or guess_split(folder, top)
        folder = split_folder(folder, split)
        if not is_guessed and (converter.name, version, split) not in {
            (each.dataset, each.version, each.split) for each in existing
        }:
            split = lake_spelling(split)  # a lake that has a partition of the given name keeps it
        for name, value in (("split", split), ("version", version)):
            if not _WORD.fullmatch(value):
                raise BadParameter(f"{name}={value!r}: use letters, digits, '.', '_' and '-'")
        listed = list(converter.shards(folder, split, version, options))
        shards = listed
        passed_over = [*converter.passed_over(folder, split, options, listed)]
        if wanted.selection:
            shards = wanted.selection.select(listed)
            left_out = count_items(listed) - count_items(shards)
            if left_out:
                passed_over.append(PassedOver("raw inputs", left_out, "not selected"))
        plans = []
        may = {"may_replace": wanted.replace, "reconvert_stale": wanted.reconvert_stale}
        for each in (converter.maps(folder, version, options), shards):
            plan = make_plan(each, existing, converter.version, **may)
            # Sorted here, because the mirror holds the file sizes of recordings in an object store.
            ordered = largest_first(plan.shards) if sort else plan.shards
            plans.append(replaced(plan, shards=tuple(map(mirror.original, ordered) if mirror else ordered)))
    return files, plans[0], replaced(plans[1], passed_over=tuple(passed_over))


def count_items(shards: Sequence[Shard]) -> int:
    """Number of raw inputs of shards."""
    return sum(len(shard.items) for shard in shards)
