"""A lake with ordinary and unusual scenarios, and two databases."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake
from scenarionet_pipelines.report import ReportContents, gather
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import odd_scenarios


@pytest.fixture(scope="package")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    found = write_lake(tmp_path_factory.mktemp("reported") / "lake", odd_scenarios()[:12])
    found.filter("num_objects > 7", name="busy")
    found.filter("num_objects <= 7", name="calm")
    return found


@pytest.fixture(scope="package")
def contents(lake: Lake) -> ReportContents:
    """A report of the whole lake."""
    return gather(lake)
