"""One shard of work: what it is, and how a worker does it."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from scenarionet_data import converters
from scenarionet_data.conversion.remote_raw.downloads import at_hand
from scenarionet_data.conversion.remote_raw.listing import rename
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import LakeError, SourceError
from scenarionet_data.execution.worker import peak_memory, worker_name
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.quality.audit import audit, audit_shared_map
from scenarionet_data.storage.files.opening import open_files
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_finished
from scenarionet_data.storage.write.shard_writer import ShardWriter
from scenarionet_data.storage.write.shared_map import write_shared_map


@dataclass(frozen=True)
class Job:
    """A shard to convert, with all a worker needs; picklable.

    Attributes:
        converter: Name of the converter.
        shard: What to convert.
        lake: The lake's root.
        max_scenarios: Stop after that many.
        is_checked: Whether the hard rules of ``sql/checks`` are asked before anything is written.
    """

    converter: str
    shard: Shard
    lake: str
    max_scenarios: int | None = None
    is_checked: bool = True


@dataclass(frozen=True)
class Outcome:
    """What became of a shard.

    Attributes:
        shard: Its name.
        record: The finished shard; None when it failed.
        error: Why it failed.
        was_finished: An earlier job had finished it already.
        seconds: Time it took.
        worker: Name of the process that converted it; None if the job killed it.
        peak_memory: Peak memory of that process [bytes].
    """

    shard: str
    record: ShardRecord | None
    error: str | None = None
    was_finished: bool = False
    seconds: float = 0.0
    worker: str | None = None
    peak_memory: int = 0


def lost_shard(job: Job, reason: str) -> Outcome:
    """The outcome of a shard that no worker survived."""
    return Outcome(job.shard.name, None, error=reason)


def convert_map(job: Job) -> Outcome:
    """Convert one shared map.

    Raises:
        BrokenContract: It breaks a hard rule; no scenario can be trusted that needs it.
    """
    converter, shard, files = converters.get(job.converter), job.shard, open_files(job.lake)
    try:
        with at_hand(converter, shard) as here, _without_collections():
            features = converter.map_features(here)
    except SourceError as error:
        return Outcome(shard.name, None, error=str(error))
    record = write_shared_map(files, shard, features, converter.version, converter.licence)
    if job.is_checked:
        audit_shared_map(files, record)
    return Outcome(shard.name, record)


def convert_shard(job: Job) -> Outcome:
    """Convert one shard, or adopt it if an earlier job finished it, and measure that. Runs on a worker.

    A record that cannot become a scenario goes to quarantine and the shard goes on; a shard that cannot be
    read fails alone.

    Raises:
        LakeError: The lake cannot be written; no other shard could be either.
    """
    started = time.monotonic()
    outcome = _convert_shard(job)
    return replace(outcome, seconds=time.monotonic() - started, worker=worker_name(), peak_memory=peak_memory())


def _convert_shard(job: Job) -> Outcome:
    converter, files, shard = converters.get(job.converter), open_files(job.lake), job.shard
    if job.max_scenarios is None:
        finished = find_finished(files, shard, converter.version)
        if finished:
            return Outcome(shard.name, finished, was_finished=True)
    else:
        shard = replace(shard, name=f"{shard.name}-first{job.max_scenarios}")
    writer = ShardWriter(files, shard, converter.version, converter.licence, audit if job.is_checked else None)
    try:
        with at_hand(converter, shard) as here:
            num_records = _write_scenarios(converter, here, shard.root, writer, job.max_scenarios)
        record = writer.finish(job.max_scenarios, num_records)
    except (LakeError, MemoryError):
        raise
    except SourceError as error:
        return Outcome(shard.name, None, error=str(error))
    except Exception as error:  # a converter's own fault with one file must not end the run
        message = f"{type(error).__name__}: {error} (while reading {shard.root})"
        return Outcome(shard.name, None, error=message)
    finally:
        writer.abandon()
    return Outcome(shard.name, record)


def _write_scenarios(
    converter: Converter[Any], shard: Shard, root: str, writer: ShardWriter, max_scenarios: int | None
) -> int:
    """Hand a shard's scenarios to its writer; returns how many records were read.

    The reason why a record is none names its files below ``root``, where the recordings really are.
    """
    num_records = 0
    for position, record in enumerate(converter.records(shard)):
        if writer.num_scenarios == max_scenarios:
            break
        num_records += 1
        try:
            with _without_collections():
                writer.add(converter.scenario(shard, record))
        except (MemoryError, LakeError, SourceError):
            raise
        except Exception as error:  # whatever a damaged record provokes, the rest must go on
            rename(error, shard.root, root)
            writer.reject(position, error)
    return num_records


@contextmanager
def _without_collections() -> Iterator[None]:
    """No search for cycles meanwhile: a raw record may be 100,000 small objects, walked again and again for nothing.

    What one leaves behind is freed by its reference counts; cycles, if any, are found between records.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def run_limited(jobs: Iterable[Job], limit: int) -> Iterator[Outcome]:
    """One shard after the other until ``limit`` scenarios are converted."""
    left = limit
    for job in jobs:
        if left <= 0:
            return
        outcome = convert_shard(replace(job, max_scenarios=left))
        left -= outcome.record.num_scenarios if outcome.record else 0
        yield outcome
