"""Executors as chosen by --workers and --cluster, and the statistics of their workers for a person to read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, duration, size

if TYPE_CHECKING:
    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.execution.worker_stats import WorkerStats

_SHOWN = 8


class Execution:
    """How a verb runs its jobs.

    Attributes:
        executor: The workers of a cluster; None for processes of this machine.
        measured: The same, with its jobs counted in :attr:`stats`.
        stats: Statistics by worker of what :attr:`measured` ran.
    """

    def __init__(self, executor: Executor | None) -> None:
        self.executor = executor
        self.measured: Executor | None = None
        self.stats: Mapping[str, WorkerStats] = {}
        if executor is not None:
            from scenarionet_data.execution.worker_stats import MeasuringExecutor

            self.measured = measuring = MeasuringExecutor(executor)
            self.stats = measuring.stats


@contextmanager
def executor_from_options(cluster: str | None, workers: int | None, *, quiet: bool = False) -> Iterator[Execution]:
    """Open the executor that the options name, until the block ends.

    Args:
        cluster: Value of ``--cluster``.
        workers: Value of ``--workers``.
        quiet: Do not print the cluster's address.
    """
    if cluster is None:
        yield Execution(None)
        return
    from scenarionet_pipelines.cluster import open_cluster

    with open_cluster(cluster, workers) as executor:
        if not quiet:
            where = f"{count(executor.workers, 'worker')} at {executor.address}"
            click.echo(f"cluster {cluster}: {where}, dashboard {executor.dashboard}", err=True)
        yield Execution(executor)


def worker_facts(stats: Mapping[str, WorkerStats]) -> dict[str, Any]:
    """Statistics by worker as an entry of a JSON object; empty without a cluster."""
    return {"workers": {name: asdict(each) for name, each in stats.items()}} if stats else {}


def worker_rows(stats: Mapping[str, WorkerStats], noun: str = "shard") -> list[tuple[str, str]]:
    """Return one row per worker, or a single row if there are many.

    Args:
        stats: By worker.
        noun: Name of a job.
    """
    if not stats:
        return []
    if len(stats) > _SHOWN:
        jobs = sorted(each.jobs for each in stats.values())
        range_ = f"{jobs[0]:,} to {jobs[-1]:,} {noun}s each"
        most = size(max(each.peak_memory for each in stats.values()))
        return [("workers", f"{count(len(stats), 'worker')}, {range_}, at most {most} of memory")]
    return [("worker", f"{name}: {_worker_text(stats[name], noun)}") for name in sorted(stats)]


def _worker_text(stats: WorkerStats, noun: str) -> str:
    parts = [count(stats.jobs, noun)]
    parts += [count(stats.counts["scenarios"], "scenario")] if "scenarios" in stats.counts else []
    parts += [size(stats.counts["bytes"])] if "bytes" in stats.counts else []
    return ", ".join([*parts, duration(stats.seconds), f"peak memory {size(stats.peak_memory)}"])
