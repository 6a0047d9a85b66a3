"""Write scenarios as pickles that NumPy 1.26 and 2.x load."""

from __future__ import annotations

import copyreg
import errno
import pickle
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.execution.executors import Executor
from scenarionet_data.export.describe import identify, to_pickle_dict
from scenarionet_data.export.original import to_original_dict
from scenarionet_data.export.sanity import sanity_check
from scenarionet_data.scenario.description import ScenarioDescription

_NO_NAME = (errno.ENAMETOOLONG, errno.EINVAL, errno.EILSEQ)


@dataclass(frozen=True)
class WrittenPickle:
    """A pickled scenario.

    Attributes:
        scenario_id: Its id.
        path: Its file.
        other_name: Name if another scenario's file has this one already.
        num_bytes: The file's size.
        metadata: Its entry of the database's summary.
    """

    scenario_id: str
    path: Path
    other_name: str
    num_bytes: int
    metadata: dict[str, Any]


def write_scenarios(
    scenarios: Iterable[ScenarioDescription], folder: Path, original: bool
) -> Iterator[WrittenPickle | InvalidScenario]:
    """Pickle scenarios one by one; yield the reason for each that the format cannot represent.

    Args:
        scenarios: The scenarios.
        folder: Where to.
        original: Whether to write those that were converted from pickles as these were.
    """
    for scenario in scenarios:
        try:
            identity = identify(scenario)
            path = folder / identity.file_name
            if _exists(path, scenario.id):
                path = folder / identity.standard_name
                if _exists(path, scenario.id):
                    raise twice(scenario.id, path.name)
            description = to_original_dict(scenario) if original else None
            if description is None:
                description = to_pickle_dict(scenario)
                sanity_check(description)
        except InvalidScenario as error:
            yield error
            continue
        dump(description, path)
        size = path.stat().st_size
        yield WrittenPickle(scenario.id, path, identity.standard_name, size, description["metadata"])


def _exists(path: Path, scenario_id: str) -> bool:
    """Whether the file exists, also under a name that the file system takes for the same, such as one in capitals.

    Raises:
        InvalidScenario: The file system has no such names; most have none of more than 255 bytes.
    """
    try:
        path.lstat()
    except FileNotFoundError:
        return False
    except OSError as error:
        if error.errno not in _NO_NAME:
            raise
        reason = f"expected an id that fits a file name, found one of {len(path.name):,} bytes ({error.strerror})"
        raise InvalidScenario(scenario_id, "id", reason) from error
    return True


def twice(scenario_id: str, name: str) -> InvalidScenario:
    """Error for two scenarios with the same file name."""
    return InvalidScenario(scenario_id, "id", f"expected a unique file name, found {name} a second time")


def dump(value: Any, path: Path) -> None:
    """Pickle with protocol 4 so that NumPy 1.26 and 2.x load it with writable arrays; equal values give equal bytes."""
    with path.open("wb") as file:
        pickler = pickle.Pickler(file, protocol=4)
        pickler.dispatch_table = copyreg.dispatch_table.copy()
        pickler.dispatch_table[np.ndarray] = _reduce_array
        pickler.dispatch_table[_SortedSet] = lambda members: (set, (list(members),))
        pickler.dump(_canonical(value, {}))


class _SortedSet(tuple[Any, ...]):
    """Members of a set in order; pickled as a set."""


def _canonical(value: Any, texts: dict[str, str]) -> Any:
    """Copy a value so that equal texts are one object, containers are never shared, and sets are sorted.

    A pickle refers to an object that it has seen by number, and the order of a set depends on the process: without
    this, so would the bytes.
    """
    if type(value) is set:
        return _SortedSet(_canonical(member, texts) for member in sorted(value, key=repr))
    if type(value) is dict:
        return {_canonical(key, texts): _canonical(inner, texts) for key, inner in value.items()}
    if type(value) in (list, tuple):
        return type(value)(_canonical(inner, texts) for inner in value)
    return texts.setdefault(value, value) if type(value) is str else value


def _reduce_array(array: np.ndarray[Any, Any]) -> tuple[Any, ...]:
    """NumPy's pickle state in C order, rebuilt by ``numpy.ndarray``, because NumPy 2 renamed its private module."""
    state: tuple[Any, ...] = np.asarray(array, order="C").__reduce__()[2]  # type: ignore[assignment]  # typed as text
    version, shape, dtype, is_fortran, data = state
    return np.ndarray, ((0,), np.dtype(np.int8)), (version, shape, _dtype(dtype), is_fortran, data)


@lru_cache(maxsize=64)
def _dtype(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """The first of all equal types, for the reason in :func:`_canonical`."""
    return dtype


PART = 64

Entries = list[WrittenPickle | InvalidScenario]


@dataclass(frozen=True)
class _ExportPart:
    """Scenarios ``first`` to ``end - 1`` of a pickled sequence, to be written below ``draft``."""

    scenarios: bytes
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
    pickled, total = pickle.dumps(sequence), len(sequence)
    parts = [_ExportPart(pickled, draft, first, min(first + PART, total), original) for first in range(0, total, PART)]
    waiting: dict[int, Entries] = {}
    following = 0
    for first, entries in executor(parts, _write_part, _lost_part):
        waiting[first] = entries
        while following in waiting:
            yield from waiting.pop(following)
            following += PART
    for folder in draft.glob(".*"):
        shutil.rmtree(folder)


def _write_part(part: _ExportPart) -> tuple[int, Entries]:
    """Write a part, on a worker; return its number and the result of each scenario."""
    scenarios = _opened(part.scenarios)
    folder = Path(tempfile.mkdtemp(prefix=f".{part.first}-", dir=part.draft))
    chosen = (scenarios[number] for number in range(part.first, part.end))
    return part.first, [*write_scenarios(chosen, folder, part.original)]


def _lost_part(part: _ExportPart, reason: str) -> tuple[int, Entries]:
    return part.first, [
        InvalidScenario(f"scenario {k} of the database", "-", reason) for k in range(part.first, part.end)
    ]


@lru_cache(maxsize=1)
def _opened(scenarios: bytes) -> Any:
    """The scenarios, opened once per process."""
    return pickle.loads(scenarios)  # noqa: S301  # of the process that submits the part, not from the draft's folder
