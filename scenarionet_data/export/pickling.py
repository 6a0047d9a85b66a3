"""Write scenarios as pickles that NumPy 1.26 and 2.x load."""

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
from scenarionet_data.export.original import to_original_dict
from scenarionet_data.export.sanity import sanity_check
from scenarionet_data.scenario.description import ScenarioDescription


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
    names: set[str] = set()
    for scenario in scenarios:
        try:
            written = _write_scenario(scenario, folder, names, original)
        except InvalidScenario as error:
            yield error
            continue
        names.add(written.path.name)
        yield written


def _write_scenario(scenario: ScenarioDescription, folder: Path, taken: set[str], original: bool) -> WrittenPickle:
    identity = identify(scenario)
    name = identity.file_name if identity.file_name not in taken else identity.standard_name
    if name in taken:
        raise twice(scenario.id, name)
    description = to_original_dict(scenario) if original else None
    if description is None:
        description = to_pickle_dict(scenario)
        sanity_check(description)
    path = folder / name
    dump(description, path)
    return WrittenPickle(scenario.id, path, identity.standard_name, path.stat().st_size, description["metadata"])


def twice(scenario_id: str, name: str) -> InvalidScenario:
    """Error for two scenarios with the same file name."""
    return InvalidScenario(scenario_id, "id", f"expected a unique file name, found {name} a second time")


def dump(value: Any, path: Path) -> None:
    """Pickle with protocol 4 so that NumPy 1.26 and 2.x load it with writable arrays."""
    with path.open("wb") as file:
        pickler = pickle.Pickler(file, protocol=4)
        pickler.dispatch_table = copyreg.dispatch_table.copy()
        pickler.dispatch_table[np.ndarray] = _reduce_array
        pickler.dump(value)


def _reduce_array(array: np.ndarray[Any, Any]) -> tuple[Any, ...]:
    """NumPy's pickle state, rebuilt by ``numpy.ndarray``, because NumPy 2 renamed its private module."""
    state = array.__reduce__()[2]
    return np.ndarray, ((0,), np.dtype(np.int8)), state
