"""Damaged pickles are dropped, quarantined or converted, with messages of this project; never a traceback."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from tests.fixtures import scenarionet_pickles as made

FOREIGN = (
    "object is not",
    "has no attribute",
    "NoneType",
    "unhashable",
    "must be",
    "argument",
    "stack underflow",
    "std::",
)
"""Words of messages of Python, NumPy and Arrow."""
NUMBER = 400


def values(random: np.random.Generator) -> Any:
    found: list[Any] = [
        None, True, -1, 1e300, float("nan"), "text", "\udcff", b"bytes", [], {}, (1, 2), {1, 2}, [[1.0], [2.0, 3.0]],
        np.zeros(0), np.full(41, np.nan), np.array(["a", "b"]), np.array([None, 1], object), np.zeros((41, 2, 2)),
        np.complex64(1),
    ]  # fmt: skip
    return found[random.integers(len(found))]


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every container in a description with each of its keys."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from places(value[key])


def damaged(number: int) -> bytes:
    """A description with one value replaced or removed, or its bytes changed."""
    random = np.random.default_rng(number)
    written = [made.waymo, made.waymo_old, made.nuscenes, made.argoverse2, made.nuplan, lambda _: made.metadrive(3)]
    description = copy.deepcopy(written[number % len(written)]("x"))
    kind = random.integers(4)
    if kind < 2:
        found = list(places(description))
        container, key = found[random.integers(len(found))]
        if kind:
            container[key] = values(random)
        else:
            del container[key]
    data = bytearray(pickle.dumps(description, 4))
    if kind == 2:
        return bytes(data[: random.integers(len(data))])
    if kind == 3:
        for _ in range(3):
            data[random.integers(len(data))] ^= 1 << random.integers(8)
    return bytes(data)


def outcome(data: bytes, folder: Path) -> str:
    """Convert a damaged pickle: what became of it."""
    path = folder / "sd_made.pkl"
    path.write_bytes(data)
    shard = Shard("scenarionet", "v1", "train", "s", str(folder), (RawItem(path.name, "0"),), Options())
    try:
        scenario = ScenarioNetPickles().scenario(shard, shard.items[0])
        scenario.validate()
    except InvalidScenario as error:
        assert not any(words in str(error) for words in FOREIGN), str(error)
        return "quarantined"
    assert not any(words in defect.reason for defect in scenario.defects for words in FOREIGN), scenario.defects
    return "dropped" if scenario.defects else "converted"


@pytest.mark.parametrize("first", [0, pytest.param(12, marks=pytest.mark.long)])
def test_damaged_pickles_are_explained(first: int, tmp_path: Path) -> None:
    trials = range(first, 12 if first == 0 else NUMBER)
    outcomes = [outcome(damaged(number), tmp_path) for number in trials]
    assert len(outcomes) == len(trials)
    assert first == 0 or set(outcomes) == {"converted", "dropped", "quarantined"}
