"""A lake with ordinary and unusual scenarios, and a running server."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from scenarionet_data import Lake
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import odd_scenarios, serving


@pytest.fixture(scope="package")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    found = write_lake(tmp_path_factory.mktemp("browsed") / "lake", odd_scenarios())
    found.filter("num_objects > 1", name="several")
    return found


@pytest.fixture(scope="package")
def served(lake: Lake) -> Iterator[str]:
    """Address of a read-only server."""
    with serving(lake) as address:
        yield address
