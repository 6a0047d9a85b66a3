"""How long a conversion will take: a few of its inputs are converted into a lake that is thrown away."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

from scenarionet_data.converters.base import Shard
from scenarionet_data.jobs import Job, convert_shard


@dataclass(frozen=True)
class Pace:
    """What was measured.

    Attributes:
        seconds: One process, one raw input.
        inputs: How many that was measured on.
        scenarios: How many scenarios they held.
    """

    seconds: float
    inputs: int
    scenarios: int

    def duration(self, inputs: int, workers: int) -> float:
        """Seconds that so many inputs take that many processes, if they are like those measured."""
        return self.seconds * inputs / max(1, min(workers, inputs))


def measure_pace(dataset: str, shards: tuple[Shard, ...], budget: float = 4.0) -> Pace | None:
    """Convert one input, then two others, then four, until half of the budget is used; the last ones count.

    What comes first also pays for imports, compilation and maps, which a long run pays once.

    Args:
        dataset: Name of the converter.
        shards: What there is to convert.
        budget: Seconds that it may take; a single input that takes longer is finished all the same.

    Returns:
        None when none of them could be converted.
    """
    started, inputs, pace = time.monotonic(), _one_by_one(shards), None
    wanted = 1
    while batch := list(islice(inputs, wanted)):
        pace = _measured(dataset, batch) or pace
        if time.monotonic() - started > budget / 2.0:
            break
        wanted *= 2
    return pace


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
