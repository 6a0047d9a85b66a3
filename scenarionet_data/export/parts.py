"""Write a database of pickles in parts with an executor: each part into its own folder, then joined.

Workers read the scenarios from a file in the database being written, so that a job is just two numbers. A part that is
repeated because its worker was lost is written into another folder.
"""

from __future__ import annotations

import pickle
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.execution.executors import Executor
from scenarionet_data.export.pickling import WrittenPickle, write_scenarios
from scenarionet_data.scenario.description import ScenarioDescription

PART = 64

_SOURCE = ".scenarios"

Entries = list[WrittenPickle | InvalidScenario]


@dataclass(frozen=True)
class _ExportPart:
    """Scenarios ``first`` to ``end - 1``, to be written below ``draft``."""

    draft: Path
    first: int
    end: int
    original: bool


def write_parts(
    scenarios: Iterable[ScenarioDescription], draft: Path, executor: Executor, original: bool
) -> Iterator[WrittenPickle | InvalidScenario]:
    """Pickle scenarios in parts; yield the result of each, in order.

    Args:
        scenarios: A picklable sequence, such as a ScenarioLoader.
        draft: The database being written, on a file system shared by all workers.
        executor: Runs the parts.
        original: Whether to write scenarios that were converted from pickles as these were.
    """
    sequence = cast(Sequence[ScenarioDescription], scenarios)
    (draft / _SOURCE).write_bytes(pickle.dumps(sequence))
    total = len(sequence)
    parts = [_ExportPart(draft, first, min(first + PART, total), original) for first in range(0, total, PART)]
    waiting: dict[int, Entries] = {}
    following = 0
    for first, entries in executor(parts, _write_part, _lost_part):
        waiting[first] = entries
        while following in waiting:
            yield from waiting.pop(following)
            following += PART
    for path in draft.glob(".*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def _write_part(part: _ExportPart) -> tuple[int, Entries]:
    """Write a part, on a worker; return its number and the result of each scenario."""
    scenarios = _source(part.draft / _SOURCE)
    folder = Path(tempfile.mkdtemp(prefix=f".{part.first}-", dir=part.draft))
    chosen = (scenarios[number] for number in range(part.first, part.end))
    return part.first, [*write_scenarios(chosen, folder, part.original)]


def _lost_part(part: _ExportPart, reason: str) -> tuple[int, Entries]:
    return part.first, [
        InvalidScenario(f"scenario {k} of the database", "-", reason) for k in range(part.first, part.end)
    ]


@lru_cache(maxsize=1)
def _source(path: Path) -> Any:
    """The scenarios, opened once per process."""
    return pickle.loads(path.read_bytes())  # noqa: S301  # written by the process that submits the part
