"""Where real recordings are found, for every test."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("scenarionet", deadline=None)  # a busy machine is no failure
settings.load_profile("scenarionet")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of real recordings; skips the test when there is none."""
    folder = os.environ.get("SCENARIONET_TEST_DATA")
    if not folder:
        pytest.skip("real recordings: set SCENARIONET_TEST_DATA to their folder")
    return Path(folder)
