"""Shard jobs: the unit of conversion work and the code that runs it on a worker."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

from scenarionet_data import converters
from scenarionet_data.conversion.remote_raw.downloads import local_copy
from scenarionet_data.conversion.remote_raw.mirror import rename_paths
from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import LakeError, SourceError
from scenarionet_data.execution.executors import peak_memory, worker_name
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.public_names import paused_collector
from scenarionet_data.quality.audit import audit, audit_shared_map
from scenarionet_data.storage.files.places import is_url, open_files
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, find_finished
from scenarionet_data.storage.write.map_tiles import write_shared_map
from scenarionet_data.storage.write.shard_writer import ShardWriter


@dataclass(frozen=True)
class ShardJob:
    """A shard to convert, with everything a worker needs; picklable.

    Attributes:
        converter: Name of the converter.
        shard: The shard.
        lake: The lake's root.
        max_scenarios: Stop after this many.
        check: Apply the hard rules of ``sql/checks`` before writing.
    """

    converter: str
    shard: Shard
    lake: str
    max_scenarios: int | None = None
    check: bool = True


@dataclass(frozen=True)
class ShardResult:
    """Result of a shard job.

    Attributes:
        shard: The shard's name.
        record: The finished shard; None if it failed.
        error: Why it failed.
        was_finished: An earlier job had finished it already.
        seconds: Time taken.
        worker: Name of the process that ran the job; None if the job killed it.
        peak_memory: Peak memory of that process [bytes].
    """

    shard: str
    record: ShardRecord | None
    error: str | None = None
    was_finished: bool = False
    seconds: float = 0.0
    worker: str | None = None
    peak_memory: int = 0


def lost_shard(job: ShardJob, reason: str) -> ShardResult:
    """Make the result of a shard that kills its worker."""
    return ShardResult(job.shard.name, None, error=reason)


def convert_map(job: ShardJob) -> ShardResult:
    """Convert one shared map.

    Raises:
        BrokenContract: It breaks a hard rule, which would affect every scenario on it.
    """
    converter, shard, files = converters.get(job.converter), job.shard, open_files(job.lake)
    try:
        with _local(converter, shard) as local, paused_collector():
            features = converter.map_features(local)
    except SourceError as error:
        return ShardResult(shard.name, None, error=str(error))
    except MemoryError:
        raise
    except Exception as error:  # a converter's bug with one map must not end the run
        return ShardResult(shard.name, None, error=_unexpected(error, shard))
    record = write_shared_map(files, shard, features, converter.version, converter.licence)
    if job.check:
        audit_shared_map(files, record)
    return ShardResult(shard.name, record)


def convert_shard(job: ShardJob) -> ShardResult:
    """Convert one shard, or adopt it if an earlier job finished it. Runs on a worker.

    A record that does not make a valid scenario goes to quarantine and the shard continues; a shard that cannot be
    read fails without affecting others.

    Raises:
        LakeError: The lake cannot be written, so no other shard could be either.
    """
    started = time.monotonic()
    converter, files, shard = converters.get(job.converter), open_files(job.lake), job.shard
    record, reason, was_finished = None, None, False
    if job.max_scenarios is None:
        record = find_finished(files, shard, converter.version)
        was_finished = record is not None
    else:
        shard = replace(shard, name=f"{shard.name}-first{job.max_scenarios}")
    if record is None:
        writer = ShardWriter(files, shard, converter.version, converter.licence, audit if job.check else None)
        try:
            with _local(converter, shard) as local:
                num_records = _write_scenarios(converter, local, shard.root, writer, job.max_scenarios)
            record = writer.finish(job.max_scenarios, num_records)
        except (LakeError, MemoryError):
            raise
        except SourceError as error:
            reason = str(error)
        except Exception as error:  # a converter's bug with one file must not end the run
            reason = _unexpected(error, shard)
        finally:
            writer.abandon()
    seconds = time.monotonic() - started
    return ShardResult(shard.name, record, reason, was_finished, seconds, worker_name(), peak_memory())


def _unexpected(error: Exception, shard: Shard) -> str:
    """Text for an error that the converter does not expect."""
    return f"{type(error).__name__}: {error} (while reading {shard.root})"


def _local(converter: Converter[Any], shard: Shard) -> Any:
    """The shard with its files on this machine, as a context manager."""
    return local_copy(converter, shard) if is_url(shard.root) else nullcontext(shard)


def _write_scenarios(
    converter: Converter[Any], shard: Shard, root: str, writer: ShardWriter, max_scenarios: int | None
) -> int:
    """Write a shard's scenarios and quarantine unusable records; return the number of records read.

    Reasons in the quarantine name files below ``root``, the original location of the recordings.
    """
    num_records = 0
    for position, record in enumerate(converter.records(shard)):
        if writer.num_scenarios == max_scenarios:
            break
        num_records += 1
        try:
            with paused_collector():
                writer.add(converter.scenario(shard, record))
        except (MemoryError, LakeError, SourceError):
            raise
        except Exception as error:  # any error caused by one damaged record; the others continue
            rename_paths(error, shard.root, root)
            writer.reject(position, error)
    return num_records


def run_limited(jobs: Iterable[ShardJob], limit: int) -> Iterator[ShardResult]:
    """Run jobs one after the other until ``limit`` scenarios are converted."""
    left = limit
    for job in jobs:
        if left <= 0:
            return
        result = convert_shard(replace(job, max_scenarios=left))
        left -= result.record.num_scenarios if result.record else 0
        yield result
