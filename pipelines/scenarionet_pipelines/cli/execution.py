"""Executors selected by ``--workers`` and ``--cluster``, and what each worker did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, duration, size

if TYPE_CHECKING:
    from scenarionet_data.execution.executors import Executor, WorkerStats

_MAX_WORKER_ROWS = 8


@dataclass(frozen=True)
class Execution:
    """Where the jobs of a verb run.

    Attributes:
        executor: The executor of ``--cluster``; None for processes on this machine.
        measured: The same executor, which also fills :attr:`stats`.
        stats: Jobs, time and memory by worker, of the jobs given to :attr:`measured`.
    """

    executor: Executor | None = None
    measured: Executor | None = None
    stats: Mapping[str, WorkerStats] = field(default_factory=dict)


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
    from scenarionet_data.execution.executors import MeasuringExecutor
    from scenarionet_pipelines.cluster import open_cluster

    with open_cluster(cluster, workers) as executor:
        if not quiet:
            where = f"{count(executor.workers, 'worker')} at {executor.address}"
            dashboard = executor.dashboard
            click.echo(f"cluster {cluster}: {where}{f', dashboard {dashboard}' if dashboard else ''}", err=True)
        measured = MeasuringExecutor(executor)
        yield Execution(executor, measured, measured.stats)


def worker_facts(stats: Mapping[str, WorkerStats]) -> dict[str, Any]:
    """Return the statistics by worker as an entry of a JSON object; empty without a cluster."""
    return {"workers": {name: asdict(each) for name, each in stats.items()}} if stats else {}


def worker_rows(stats: Mapping[str, WorkerStats], noun: str = "shard") -> list[tuple[str, str]]:
    """Return table rows: one per worker, or a summary if there are many.

    Args:
        stats: Statistics by worker.
        noun: What one job handles, for example ``"shard"``.
    """
    if not stats:
        return []
    if len(stats) > _MAX_WORKER_ROWS:
        jobs = sorted(each.jobs for each in stats.values())
        per_worker = f"{jobs[0]:,} to {jobs[-1]:,} {noun}s each"
        peak = size(max(each.peak_memory for each in stats.values()))
        return [("workers", f"{count(len(stats), 'worker')}, {per_worker}, peak memory at most {peak}")]
    rows = []
    for name, each in sorted(stats.items()):
        parts = [count(each.jobs, noun)]
        parts += [count(each.counts["scenarios"], "scenario")] if "scenarios" in each.counts else []
        parts += [size(each.counts["bytes"])] if "bytes" in each.counts else []
        parts += [duration(each.seconds), f"peak memory {size(each.peak_memory)}"]
        rows.append(("worker", f"{name}: {', '.join(parts)}"))
    return rows
