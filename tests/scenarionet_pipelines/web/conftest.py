"""A lake with ordinary and unusual scenarios, and a running server."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from scenarionet_data import Lake
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots.commit import commit
from scenarionet_sim import evaluate
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake, write_shard
from tests.fixtures.pages import launched, odd_scenarios, serving
from tests.fixtures.simulations import generated


@pytest.fixture(scope="package")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    found = write_lake(tmp_path_factory.mktemp("browsed") / "lake", odd_scenarios())
    found.filter("num_objects > 1", name="several")
    return found


@pytest.fixture(scope="package")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    """A lake with two runs: one that keeps its speed and direction into a parked car and off the road, and IDM."""
    parked = make_drive("parked", others=(Other(25.0), Other(10.0, 3.5, vx=8.0)))
    lake = write_lake(tmp_path_factory.mktemp("driven") / "made", [parked, make_drive("free")])
    for scenario in (write_shard(lake.root, [generated(seed)], f"pg{seed}") for seed in (3, 13)):
        commit(open_files(lake.root), [scenario], "test")
    lake = Lake(lake.root)
    for name, policy in (("straight", "constant"), ("idm", "idm")):
        evaluate(lake, policy=policy, backend="kinematic", name=name)
    return lake


@pytest.fixture(scope="package")
def served(lake: Lake) -> Iterator[str]:
    """Address of a read-only server."""
    with serving(lake) as address:
        yield address


@pytest.fixture(scope="module")
def address(driven: Lake) -> Iterator[str]:
    """Address of a read-only server of the lake with runs."""
    with serving(driven) as found:
        yield found


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser without a window."""
    with launched() as found:
        yield found
