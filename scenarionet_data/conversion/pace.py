"""How long a conversion will take: a few of its inputs are converted into a lake that is thrown away."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

from scenarionet_data.conversion.jobs import Job, convert_shard
from scenarionet_data.conversion.remote_raw.downloads import kept_meanwhile
from scenarionet_data.ingest.shard import Shard


@dataclass(frozen=True)
class Pace:
    """What was measured.

    Attributes:
        seconds: One process, one raw input.
        inputs: How many that was measured on.
        scenarios: How many scenarios they held.
        start: Seconds that a process takes more for its first input: imports, tables, maps.
    """

    seconds: float
    inputs: int
    scenarios: int
    start: float = 0.0

    def duration(self, inputs: int, workers: int) -> float:
        """Seconds that so many inputs take that many processes, if they are like those measured."""
        return (self.start + self.seconds * inputs / max(1, min(workers, inputs))) if inputs else 0.0


@kept_meanwhile()
def measure_pace(dataset: str, shards: tuple[Shard, ...], budget: float = 4.0) -> Pace | None:
    """Convert one input, then another, then two, four, ..., until half of the budget is used; the last ones count.

    The first one also pays for imports, compilation, tables and maps, which a long run pays once a process: for
    some datasets that is minutes, so there is always a second one.

    Args:
        dataset: Name of the converter.
        shards: What there is to convert.
        budget: Seconds that it may take after the first input; one that takes longer is finished all the same.

    Returns:
        None when none of them could be converted.
    """
    inputs = _one_by_one(shards)
    first = _measured(dataset, list(islice(inputs, 1)))
    started, wanted, pace = time.monotonic(), 1, first
    while batch := list(islice(inputs, wanted)):
        pace = _measured(dataset, batch) or pace
        if time.monotonic() - started > budget / 2.0:
            break
        wanted *= 2
    if first is None or pace is None:
        return pace
    return replace(pace, start=max(0.0, first.seconds - pace.seconds))


def _one_by_one(shards: tuple[Shard, ...]) -> Iterator[Shard]:
    return (replace(shard, items=(item,)) for shard in shards for item in shard.items)


def _measured(dataset: str, inputs: list[Shard]) -> Pace | None:
    """The pace over some inputs, those of one shard together as they will be."""
    together: dict[str, Shard] = {}
    for one in inputs:
        items = together[one.name].items if one.name in together else ()
        together[one.name] = replace(one, items=(*items, *one.items))
    with tempfile.TemporaryDirectory(prefix="scenarionet-pace-") as folder:
        started = time.monotonic()
        outcomes = [convert_shard(Job(dataset, shard, folder)) for shard in together.values()]
        seconds = time.monotonic() - started
    scenarios = sum(outcome.record.num_scenarios for outcome in outcomes if outcome.record)
    return Pace(seconds / len(inputs), len(inputs), scenarios) if scenarios else None
