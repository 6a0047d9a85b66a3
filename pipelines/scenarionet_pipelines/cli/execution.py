"""Who does the jobs of a verb, as --workers and --cluster say, and what each of them did, for a person."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, duration, size

if TYPE_CHECKING:
    from scenarionet_data.execution.executors import Run
    from scenarionet_data.execution.worker_stats import Share

_SHOWN = 8


class Hands:
    """Who does the jobs of a verb.

    Attributes:
        run: The workers of a cluster; None for processes of this machine.
        shares: What each of them did of what was done by :attr:`tallied`.
    """

    def __init__(self, run: Run | None) -> None:
        self.run = run
        self.tallied: Run | None = None
        self.shares: Mapping[str, Share] = {}
        if run is not None:
            from scenarionet_data.execution.worker_stats import Tally

            tally = Tally()
            self.tallied, self.shares = partial(tally, run), tally.shares


@contextmanager
def crew(cluster: str | None, workers: int | None, *, quiet: bool = False) -> Iterator[Hands]:
    """Who does the jobs, until the block ends.

    Args:
        cluster: As typed.
        workers: As typed.
        quiet: Do not say where the cluster is.
    """
    if cluster is None:
        yield Hands(None)
        return
    from scenarionet_pipelines.cluster import open_cluster

    with open_cluster(cluster, workers) as opened:
        if not quiet:
            there = f"{count(opened.workers, 'worker')} at {opened.address}"
            click.echo(f"cluster {cluster}: {there}, dashboard {opened.dashboard}", err=True)
        yield Hands(opened)


def share_facts(shares: Mapping[str, Share]) -> dict[str, Any]:
    """What each worker did, as an entry of a JSON object; none without a cluster."""
    return {"workers": {name: asdict(share) for name, share in shares.items()}} if shares else {}


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
