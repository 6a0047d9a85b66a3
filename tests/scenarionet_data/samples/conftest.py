"""A small lake of scenarios with gaps, changing sizes and times of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

COUNT = 6


def made(seed):
    """Without heights for every third one; the fourth has no map, the last is short; the ego is in the row ``seed``."""
    scenario = make_scenario(seed, num_steps=12 if seed == 5 else 31, has_z=seed % 3 > 0, has_map=seed != 4)
    return scenario.with_tracks(scenario.tracks.take(np.roll(np.arange(len(scenario.tracks)), seed)))


@pytest.fixture(scope="session")
def lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("samples"), [made(seed) for seed in range(COUNT)])
