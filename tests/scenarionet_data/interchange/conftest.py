"""A lake of generated scenarios."""

import pytest

from scenarionet_data import convert


@pytest.fixture(scope="session")
def lake(tmp_path_factory):
    folder = tmp_path_factory.mktemp("interchange") / "lake"
    convert("pg", "5:10", folder)
    return folder
