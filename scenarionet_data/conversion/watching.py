"""Watch a folder of raw recordings and convert each input once it is no longer being written."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace as replaced
from pathlib import Path

from scenarionet_data.conversion.committer import ConversionReport
from scenarionet_data.conversion.plan import InputSelection
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.shard import Shard

FileState = tuple[str, int, int]
"""Fingerprint, size [bytes] and modification time [ns] of a raw input."""


class SettledInputs:
    """Selects the raw inputs that have not changed since the previous call: others are still being written.

    Args:
        selection: Restricts the inputs.
    """

    def __init__(self, selection: InputSelection | None = None) -> None:
        self._selection = selection or InputSelection()
        self._seen: dict[tuple[str, str], FileState] = {}
        self._offered: dict[str, dict[tuple[str, str], FileState]] = {}
        self._given_up: dict[tuple[str, str], FileState] = {}

    def select(self, shards: Iterable[Shard]) -> list[Shard]:
        """Shards with the inputs that have settled since the previous call."""
        found: dict[tuple[str, str], FileState] = {}
        settled = []
        self._offered = {}
        for shard in self._selection.select(shards):
            unchanged: dict[tuple[str, str], FileState] = {}
            for item in shard.items:
                try:
                    status = (Path(shard.root) / item.name).stat()
                    # A fingerprint samples a large file: size and time show that it grows.
                    state = item.fingerprint, status.st_size, status.st_mtime_ns
                except OSError:  # no file: a seed, or part of a file
                    state = item.fingerprint, 0, 0
                key = shard.split, item.name
                found[key] = state
                if self._seen.get(key) == state != self._given_up.get(key):
                    unchanged[key] = state
            items = tuple(item for item in shard.items if (shard.split, item.name) in unchanged)
            if items:
                settled.append(replaced(shard, items=items))
                self._offered[shard.name] = unchanged
        self._seen = found
        return settled

    def give_up(self, names: Iterable[str]) -> None:
        """Do not offer the inputs of these shards again until they change."""
        for name in names:
            self._given_up |= self._offered.get(name, {})


def watch(
    converting: Callable[..., ConversionReport],
    *,
    every: float = 30.0,
    selection: InputSelection | None = None,
    wait: Callable[[float], None] = time.sleep,
) -> Iterator[ConversionReport]:
    """Convert new recordings as they arrive, forever; yield a report whenever something was converted.

    A shard that fails is reported once, and tried again after its recordings have changed.

    Args:
        converting: Converts the recordings of one keyword argument ``selection``, for example
            ``partial(convert, "waymo", raw, lake, workers=4)``; the folder ``raw`` may still be empty.
        every: Seconds between two scans: an input is converted once it is unchanged for this long.
        selection: Which of the recordings to convert; all by default.
        wait: Sleeps for a number of seconds.

    Raises:
        DuplicateScenario: A recording that is in the lake has changed.
        ScenarioNetError: See :func:`~scenarionet_data.conversion.driver.convert`.
    """
    settled = SettledInputs(selection)
    while True:
        try:
            report = converting(selection=settled)
        except SourceNotFound:  # nothing there yet
            report = ConversionReport()
        if report.shards or report.failed:
            settled.give_up(name for name, _ in report.failed)
            yield report
        wait(every)
