"""A lake folder and a small conversion template to fill it."""

from __future__ import annotations

import pytest

from scenarionet_data.storage.files.local import LocalLakeFiles
from tests.fixtures.scenarios import small


@pytest.fixture(scope="session")
def template():
    return small(1)


@pytest.fixture
def files(tmp_path):
    return LocalLakeFiles(tmp_path / "lake")
