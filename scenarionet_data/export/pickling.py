"""Scenarios to files: one pickle each, as numpy 1.26 and 2.x load it."""

from __future__ import annotations

import copyreg
import pickle
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.export.describe import identify, to_pickle_dict
from scenarionet_data.export.sanity import sanity_check
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True)
class Written:
    """A pickled scenario.

    Attributes:
        scenario_id: Which.
        path: Its file.
        num_bytes: The file's size.
        metadata: Its entry of the database's summary.
    """

    scenario_id: str
    path: Path
    num_bytes: int
    metadata: dict[str, Any]


def write_scenarios(scenarios: Iterable[ScenarioDescription], folder: Path) -> Iterator[Written | InvalidScenario]:
    """Pickle scenarios one by one; in place of one that the format cannot hold, the reason."""
    names: set[str] = set()
    for scenario in scenarios:
        try:
            written = _write_scenario(scenario, folder, names)
        except InvalidScenario as error:
            yield error
            continue
        names.add(written.path.name)
        yield written


def _write_scenario(scenario: ScenarioDescription, folder: Path, taken: set[str]) -> Written:
    path = folder / identify(scenario).file_name
    if path.name in taken:
        raise twice(scenario.id, path.name)
    description = to_pickle_dict(scenario)
    sanity_check(description)
    dump(description, path)
    return Written(scenario.id, path, path.stat().st_size, description["metadata"])


def twice(scenario_id: str, name: str) -> InvalidScenario:
    """Two scenarios want the same file."""
    return InvalidScenario(scenario_id, "id", f"wanted a file name of its own, found {name} a second time")


def dump(value: Any, path: Path) -> None:
    """Pickle so that numpy 1.26 and 2.x load it, and arrays come back writable (protocol 4)."""
    with path.open("wb") as file:
        pickler = pickle.Pickler(file, protocol=4)
        pickler.dispatch_table = copyreg.dispatch_table.copy()
        pickler.dispatch_table[np.ndarray] = _reduce_array
        pickler.dump(value)


def _reduce_array(array: np.ndarray[Any, Any]) -> tuple[Any, ...]:
    """State as numpy pickles it, but rebuilt by ``numpy.ndarray``: numpy 2 renamed its private module."""
    state = array.__reduce__()[2]
    return np.ndarray, ((0,), np.dtype(np.int8)), state
