"""The Lyft reader and converter agree with what zarr reads from the same recording."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.formats.zarr2 import ChunkedTable
from scenarionet_data.converters.lyft import Lyft
from scenarionet_data.converters.lyft.recording import LyftRecording
from tests.devkits.environments import read_with
from tests.fixtures import lyft as fixture
from tests.fixtures.reading import scenarios

pytestmark = pytest.mark.devkits
Read = tuple[Path, Any]


@pytest.fixture(scope="module", params=["format 1", "format 2", "recorded"])
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Read:
    """A zarr folder with zarr's reading of it."""
    if request.param == "recorded":
        path = request.getfixturevalue("recordings") / "lyft" / "scenes" / "sample.zarr"
    else:
        path = tmp_path_factory.mktemp("lyft") / "a.zarr"
        fixture.write_recording(path, num_scenes=2, version=int(request.param[-1]))
    return path, read_with("readers", "lyft_reads.py", path)


def test_tables_are_equal_to_the_byte(read: Read) -> None:
    path, outside = read
    assert set(outside["tables"]) >= {"scenes", "frames", "agents"}
    for name, (length, digest) in outside["tables"].items():
        table = ChunkedTable(path / name)
        assert len(table) == length
        assert hashlib.sha256(table.rows(0, length).tobytes()).hexdigest() == digest
    assert outside["labels"] is None or LyftRecording(path).labels == tuple(outside["labels"])


def test_every_row_of_every_frame_is_a_state(read: Read) -> None:
    path, outside = read
    frame = 0
    for scenario in scenarios(Lyft(), path, has_map=False, window=1000.0):
        tracks, ego = scenario.tracks, scenario.ego_index
        for step in range(scenario.num_timesteps):
            found = {int(name) for name in np.delete(tracks.ids, ego)[np.delete(tracks.valid[:, step], ego)]}
            assert found == set(outside["seen"][frame])
            place = tracks.position[ego, step, :2] + scenario.origin[:2]
            np.testing.assert_allclose(place, outside["ego"][frame], atol=1e-3)
            frame += 1
    assert frame == len(outside["seen"])
