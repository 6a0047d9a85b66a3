"""Lakes to query, lakes to save databases in, and permission to write invalid scenarios."""

from __future__ import annotations

import shutil

import pytest

from scenarionet_data import Lake
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import NUM_VARIED, make_scenario, varied


@pytest.fixture(scope="session")
def lake(tmp_path_factory):
    """An open lake for reading only; tests that save databases use ``own``."""
    return write_lake(tmp_path_factory.mktemp("catalog"), varied())


@pytest.fixture(scope="session")
def empty_lake(tmp_path_factory):
    """An open lake without scenarios, for reading only."""
    root = tmp_path_factory.mktemp("empty")
    (root / "snapshots").mkdir()
    return Lake(root)


@pytest.fixture(scope="session")
def _own(tmp_path_factory):
    made = [make_scenario(k, num_objects=2 + k % 4, num_steps=6, num_lanes=1) for k in range(NUM_VARIED)]
    return write_lake(tmp_path_factory.mktemp("own") / "lake", made).root


@pytest.fixture
def own(_own, tmp_path):
    """A lake to save databases in."""
    return Lake(shutil.copytree(_own, tmp_path / "lake"))


@pytest.fixture
def lenient(monkeypatch):
    """What validation refuses may be written, so that checks have something to find."""
    monkeypatch.setattr(ScenarioDescription, "validate", lambda scenario: None)
