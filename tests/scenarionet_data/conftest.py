"""A lake to ask, lakes to save databases in, and leave to write what is wrong."""

from __future__ import annotations

import pytest

from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import NUM_VARIED, make_scenario, varied


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """For reading only: tests that save databases make a lake of their own."""
    return write_lake(tmp_path_factory.mktemp("catalog"), varied())


@pytest.fixture
def own(tmp_path):
    """A lake to save databases in."""
    made = [make_scenario(k, num_objects=2 + k % 4, num_steps=6, num_lanes=1) for k in range(NUM_VARIED)]
    return write_lake(tmp_path / "lake", made)


@pytest.fixture
def lenient(monkeypatch):
    """What validation refuses may be written, so that checks have something to find."""
    monkeypatch.setattr(ScenarioDescription, "validate", lambda scenario: None)
