"""Estimate how long a conversion takes by converting a few inputs into a temporary lake."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from itertools import islice

from scenarionet_data.conversion.jobs import ShardJob, convert_shard
from scenarionet_data.conversion.remote_raw.downloads import remove_downloads
from scenarionet_data.ingest.shard import Shard


@dataclass(frozen=True)
class Pace:
    """Measured duration of converting raw inputs.

    Attributes:
        seconds: Per input, in one process.
        inputs: Number of inputs measured.
        scenarios: Number of scenarios in them.
        start: Additional seconds per process for its first input: imports, compilation, tables, maps.
    """

    seconds: float
    inputs: int
    scenarios: int
    start: float = 0.0

    def duration(self, inputs: int, workers: int) -> float:
        """Estimated seconds for a number of similar inputs and processes."""
        return (self.start + self.seconds * inputs / max(1, min(workers, inputs))) if inputs else 0.0


def measure_pace(dataset: str, shards: tuple[Shard, ...], budget: float = 4.0) -> Pace | None:
    """Convert one input, then 1, 2, 4, ... more until half of the budget is used; the last batch is the result.

    The first input also pays for imports, compilation, tables and maps, once per process and up to minutes for some
    datasets; therefore a second one is always measured.

    Args:
        dataset: Name of the converter.
        shards: Shards to convert.
        budget: Seconds available after the first input; a batch that has started is finished.

    Returns:
        None if none of the inputs could be converted.
    """
    inputs = (replace(shard, items=(item,)) for shard in shards for item in shard.items)
    try:
        first = _measure(dataset, list(islice(inputs, 1)))
        started, size, pace = time.monotonic(), 1, first
        while batch := list(islice(inputs, size)):
            pace = _measure(dataset, batch) or pace
            if time.monotonic() - started > budget / 2.0:
                break
            size *= 2
    finally:
        remove_downloads()
    if first is None or pace is None:
        return pace
    return replace(pace, start=max(0.0, first.seconds - pace.seconds))


def _measure(dataset: str, inputs: list[Shard]) -> Pace | None:
    """Measure some inputs, with those of one shard together as in a real conversion."""
    shards: dict[str, Shard] = {}
    for each in inputs:
        items = shards[each.name].items if each.name in shards else ()
        shards[each.name] = replace(each, items=(*items, *each.items))
    with tempfile.TemporaryDirectory(prefix="scenarionet-pace-") as folder:
        started = time.monotonic()
        results = [convert_shard(ShardJob(dataset, shard, folder)) for shard in shards.values()]
        seconds = time.monotonic() - started
    scenarios = sum(result.record.num_scenarios for result in results if result.record)
    return Pace(seconds / len(inputs), len(inputs), scenarios) if scenarios else None
