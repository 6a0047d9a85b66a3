"""Raw recordings that grow: what has arrived is converted as soon as nobody writes to it any more."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenarionet_data.conversion.driver import convert
from scenarionet_data.conversion.report import Report
from scenarionet_data.conversion.selection import Selection
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.shard import RawItem, Shard

Mark = tuple[str, int, int]
"""Fingerprint, size [bytes] and time of change [ns] of a raw input."""


class Arrivals:
    """Chooses the raw inputs that are as they were at the look before: what changes is still being written.

    Args:
        selection: Which of the recordings are wanted at all.
    """

    def __init__(self, selection: Selection | None = None) -> None:
        self._selection = selection or Selection()
        self._seen: dict[tuple[str, str], Mark] = {}
        self._offered: dict[str, dict[tuple[str, str], Mark]] = {}
        self._given_up: dict[tuple[str, str], Mark] = {}

    def of(self, shards: Iterable[Shard]) -> list[Shard]:
        """The shards with what has settled since this was asked last."""
        found: dict[tuple[str, str], Mark] = {}
        settled = []
        self._offered = {}
        for shard in self._selection.of(shards):
            marks = {(shard.split, item.name): _mark(shard, item) for item in shard.items}
            found |= marks
            whole = {place: mark for place, mark in marks.items() if self._is_due(place, mark)}
            items = tuple(item for item in shard.items if (shard.split, item.name) in whole)
            if items:
                settled.append(replace(shard, items=items))
                self._offered[shard.name] = whole
        self._seen = found
        return settled

    def _is_due(self, place: tuple[str, str], mark: Mark) -> bool:
        return self._seen.get(place) == mark != self._given_up.get(place)

    def give_up(self, names: Iterable[str]) -> None:
        """Do not offer the inputs of these shards again as long as they stay as they are."""
        for name in names:
            self._given_up |= self._offered.get(name, {})


def _mark(shard: Shard, item: RawItem) -> Mark:
    """A fingerprint samples a large file; one that grows or is written to shows in its size and time."""
    try:
        status = (Path(shard.root) / item.name).stat()
    except OSError:  # no file: a seed, or something inside of one
        return item.fingerprint, 0, 0
    return item.fingerprint, status.st_size, status.st_mtime_ns


def watch(
    dataset: str,
    raw: str,
    lake: str | Path,
    *,
    every: float = 30.0,
    selection: Selection | None = None,
    wait: Callable[[float], None] = time.sleep,
    **how: Any,
) -> Iterator[Report]:
    """Convert what arrives, for ever; a report whenever there was something to do.

    A shard that fails is reported once, and tried again when its recordings have changed.

    Args:
        dataset, raw, lake: As for :func:`~scenarionet_data.conversion.driver.convert`; ``raw`` may be empty yet.
        every: Seconds between two looks: an input is converted once it has stood unchanged for so long.
        selection: Which of the recordings; all unless given.
        wait: Waits so many seconds.
        how: What else :func:`~scenarionet_data.conversion.driver.convert` takes.

    Raises:
        DuplicateScenario: A recording that is in the lake has changed.
        ScenarioNetError: What else a conversion raises.
    """
    arrivals = Arrivals(selection)
    while True:
        try:
            report = convert(dataset, raw, lake, selection=arrivals, **how)
        except SourceNotFound:  # nothing there yet
            report = Report()
        if report.shards or report.failed:
            arrivals.give_up(name for name, _ in report.failed)
            yield report
        wait(every)
