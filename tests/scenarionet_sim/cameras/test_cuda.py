"""Frames as a graphics card draws them, by its threads' functions compiled for the processor, against the processor's.

``tests/cuda`` has the tests that need numba-cuda.
"""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.cameras.cuda import availability
from scenarionet_sim.cameras.cuda.dlpack import CPU, capsule_of
from scenarionet_sim.cameras.weather import DAY, DUSK, NIGHT, RAIN
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.worlds.world import World
from tests.cuda.scenes import ALL, MOUNT, share_alike, street_and_junction
from tests.fixtures.simulations import generated

LOOKS = {
    "pinhole": Camera(640, 360, channels=ALL, mount=MOUNT, weather=DAY),
    "fisheye": Camera(320, 240, channels=ALL, lens="fisheye", fov=2.4, weather=RAIN, own="inside"),
    "distorted": Camera(320, 200, channels=ALL, distortion=(-0.2, 0.05), own="outside", vignette=0.3, weather=DUSK),
    "boxes": Camera(84, 84, channels=ALL, are_boxes=True, has_scenery=False),
    "night": Camera(320, 180, channels=("rgb",), weather=NIGHT, own="outside"),
    "supersampled": Camera(160, 90, supersampling=2),
}
AGENTS = np.array([[0, 0], [1, 0], [1, 3]], np.int32)


class Exporter:
    """An array that only speaks DLPack."""

    def __init__(self, array):
        self.array = array

    def __dlpack_device__(self):
        return CPU, 0

    def __dlpack__(self, **_):
        return capsule_of(self, self.array.ctypes.data, self.array.shape, self.array.dtype, (CPU, 0))


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float32])
def test_capsules_share_memory_that_lives_as_long_as_its_consumer(dtype):
    exporter = Exporter(np.arange(24, dtype=dtype).reshape(2, 3, 4))
    taken = np.from_dlpack(exporter)
    exporter.array[1, 2, 3] = 99
    assert taken.dtype == dtype and taken.shape == (2, 3, 4) and taken[1, 2, 3] == 99
    expected = exporter.array.copy()
    exporter.__dlpack__()  # a capsule that is not used
    del exporter
    gc.collect()
    np.testing.assert_array_equal(taken, expected)


def test_devices_are_checked_with_a_remedy(monkeypatch):
    with pytest.raises(BadParameter, match="device='tpu'; choose from cpu, cuda"):
        Camera(device="tpu")
    monkeypatch.setattr(availability, "find_spec", lambda _: None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[cuda\]"):
        availability.require_cuda()


@pytest.fixture(scope="module")
def drive():
    return street_and_junction()


@pytest.fixture
def card(monkeypatch):
    played_card = pytest.importorskip("tests.cuda.played_card")
    monkeypatch.setattr("scenarionet_sim.sensors.camera.require_cuda", lambda: None)
    return played_card.PlayedCard(monkeypatch)


@pytest.mark.long  # compiles the camera twice
@pytest.mark.parametrize("name", LOOKS)
def test_frames_are_those_of_the_processor(name, drive, card):
    camera = LOOKS[name]
    expected = camera.frames(drive.batch, drive.state, AGENTS)
    found = replace(camera, device="cuda").frames(drive.batch, drive.state, AGENTS)
    assert card.launches
    for channel, values in found.items():
        assert values.dtype == expected[channel].dtype and values.shape == expected[channel].shape
        assert share_alike(values, expected[channel]) >= 0.999, channel
        assert len(np.unique(values)) > 3, channel


@pytest.mark.long
def test_scenes_are_uploaded_once(card):
    drive = street_and_junction()
    camera = Camera(32, 20, device="cuda")
    first = camera.frames(drive.batch, drive.state, AGENTS)["rgb"]
    uploaded = len(card.uploads)
    np.testing.assert_array_equal(camera.frames(drive.batch, drive.state, AGENTS)["rgb"], first)
    assert uploaded and len(card.uploads) == uploaded


@pytest.mark.long
def test_worlds_that_are_replaced_are_drawn(card):
    drive = street_and_junction()
    camera = Camera(64, 36)
    before = replace(camera, device="cuda").frames(drive.batch, drive.state, AGENTS)["rgb"]
    drive.reset(0, World.from_scenario(generated(5)))
    expected = camera.frames(drive.batch, drive.state, AGENTS)["rgb"]
    found = replace(camera, device="cuda").frames(drive.batch, drive.state, AGENTS)["rgb"]
    assert share_alike(found[:1], before[:1]) < 0.5
    assert share_alike(found, expected) >= 0.999


@pytest.mark.long
def test_noise_has_its_spread(drive, card):
    camera = Camera(96, 54, device="cuda")
    clean = camera.frames(drive.batch, drive.state, AGENTS)["rgb"].astype(float)
    noisy = replace(camera, noise=4.0).frames(drive.batch, drive.state, AGENTS, np.random.default_rng(0))["rgb"]
    inside = (clean > 40) & (clean < 215)
    added = (noisy - clean)[inside]
    assert abs(added.mean()) < 0.1 and abs(added.std() - 4.0) < 0.15
    assert abs(np.corrcoef(added[:-1], added[1:])[0, 1]) < 0.03
