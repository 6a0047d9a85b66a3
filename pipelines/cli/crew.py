"""Who does the jobs of a verb, as --workers and --cluster say, and what each of them did, for a person."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from pipelines.cli.output import count, duration, size

if TYPE_CHECKING:
    from scenarionet_data.conversion.runners import Run
    from scenarionet_data.conversion.tally import Share

_SHOWN = 8


@contextmanager
def crew(cluster: str | None, workers: int | None, *, quiet: bool = False) -> Iterator[Run | None]:
    """The workers of a cluster, until the block ends; None for processes of this machine.

    Args:
        cluster: As typed.
        workers: As typed.
        quiet: Do not say where the cluster is.
    """
    if cluster is None:
        yield None
        return
    from pipelines.cluster import open_cluster

    with open_cluster(cluster, workers) as opened:
        if not quiet:
            there = f"{count(opened.workers, 'worker')} at {opened.address}"
            click.echo(f"cluster {cluster}: {there}, dashboard {opened.dashboard}", err=True)
        yield opened


def share_rows(shares: Mapping[str, Share], noun: str = "shard") -> list[tuple[str, str]]:
    """A line for each worker, or one for all when there are many.

    Args:
        shares: By worker.
        noun: What a job is.
    """
    if not shares:
        return []
    if len(shares) > _SHOWN:
        jobs = sorted(share.jobs for share in shares.values())
        each = f"{jobs[0]:,} to {jobs[-1]:,} {noun}s each"
        most = size(max(share.peak_memory for share in shares.values()))
        return [("workers", f"{count(len(shares), 'worker')}, {each}, at most {most} of memory")]
    return [("worker", f"{name}: {_share(shares[name], noun)}") for name in sorted(shares)]


def _share(share: Share, noun: str) -> str:
    parts = [count(share.jobs, noun)]
    parts += [count(share.counts["scenarios"], "scenario")] if "scenarios" in share.counts else []
    parts += [size(share.counts["bytes"])] if "bytes" in share.counts else []
    return ", ".join([*parts, duration(share.seconds), f"peak memory {size(share.peak_memory)}"])
