"""Executors selected by ``--workers`` and ``--cluster``, and what each worker did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, duration, size

if TYPE_CHECKING:
    from scenarionet_data.execution.executors import Run
    from scenarionet_data.execution.worker_stats import Share

_MAX_WORKER_ROWS = 8


@dataclass(frozen=True)
class Execution:
    """Where the jobs of a verb run.

    Attributes:
        executor: The executor of ``--cluster``; None for processes on this machine.
        measured: The same executor, which also fills :attr:`workers`.
        workers: Jobs, time and memory by worker, of the jobs given to :attr:`measured`.
    """

    executor: Run | None = None
    measured: Run | None = None
    workers: Mapping[str, Share] = field(default_factory=dict)


@contextmanager
def executor_from_options(cluster: str | None, workers: int | None, *, quiet: bool = False) -> Iterator[Execution]:
    """Open the executor that the options select; a cluster it started is closed at the end of the block.

    Args:
        cluster: Value of ``--cluster``.
        workers: Value of ``--workers``.
        quiet: Do not print the cluster's addresses.
    """
    if cluster is None:
        yield Execution()
        return
    from scenarionet_data.execution.worker_stats import Tally
    from scenarionet_pipelines.cluster import open_cluster

    with open_cluster(cluster, workers) as executor:
        if not quiet:
            where = f"{count(executor.workers, 'worker')} at {executor.address}"
            click.echo(f"cluster {cluster}: {where}, dashboard {executor.dashboard}", err=True)
        stats = Tally()
        yield Execution(executor, partial(stats, executor), stats.shares)


def workers_as_json(workers: Mapping[str, Share]) -> dict[str, Any]:
    """Return what each worker did as an entry of a JSON object; empty without a cluster."""
    return {"workers": {name: asdict(share) for name, share in workers.items()}} if workers else {}


def worker_rows(workers: Mapping[str, Share], noun: str = "shard") -> list[tuple[str, str]]:
    """Return table rows: one per worker, or a summary if there are many.

    Args:
        workers: Statistics by worker.
        noun: What one job handles, for example ``"shard"``.
    """
    if not workers:
        return []
    if len(workers) > _MAX_WORKER_ROWS:
        jobs = sorted(share.jobs for share in workers.values())
        each = f"{jobs[0]:,} to {jobs[-1]:,} {noun}s each"
        peak = size(max(share.peak_memory for share in workers.values()))
        return [("workers", f"{count(len(workers), 'worker')}, {each}, peak memory at most {peak}")]
    return [("worker", f"{name}: {_worker(workers[name], noun)}") for name in sorted(workers)]


def _worker(share: Share, noun: str) -> str:
    parts = [count(share.jobs, noun)]
    parts += [count(share.counts["scenarios"], "scenario")] if "scenarios" in share.counts else []
    parts += [size(share.counts["bytes"])] if "bytes" in share.counts else []
    return ", ".join([*parts, duration(share.seconds), f"peak memory {size(share.peak_memory)}"])
