"""Frames drawn by numba-cuda, on a graphics card or in its simulator (``NUMBA_ENABLE_CUDASIM=1``), against the
processor's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numba.core import config

from scenarionet_data.compiled.dispatchers import DeviceFunction
from scenarionet_sim.cameras.weather import DAY, RAIN
from scenarionet_sim.sensors.camera import Camera
from tests.cuda.scenes import ALL, MOUNT, share_alike, street

IS_SIMULATED = bool(config.ENABLE_CUDASIM)
SIZE = (40, 24) if IS_SIMULATED else (1280, 720)
CAMERAS = {
    "pinhole": Camera(*SIZE, channels=ALL, mount=MOUNT, weather=DAY),
    "fisheye": Camera(*SIZE, channels=ALL, lens="fisheye", fov=2.4, weather=RAIN, own="inside"),
}
AGENTS = np.array([[0, 0]], np.int32)

pytestmark = [pytest.mark.cuda, pytest.mark.filterwarnings("ignore::RuntimeWarning")]  # Python's own divisions by 0


@pytest.fixture(autouse=True)
def card(monkeypatch):
    """A card, or the simulator, in which device functions are Python."""
    pytest.importorskip("numba_cuda")
    import numba.cuda

    if not numba.cuda.is_available():
        pytest.skip("no graphics card; NUMBA_ENABLE_CUDASIM=1 simulates one")
    if IS_SIMULATED:
        monkeypatch.setattr(DeviceFunction, "__call__", lambda self, *values: self.py_func(*values))


@pytest.fixture(scope="module")
def drive():
    return street()


@pytest.mark.parametrize("name", CAMERAS)
def test_frames_are_those_of_the_processor(name, drive):
    camera = CAMERAS[name]
    expected = camera.frames(drive.batch, drive.state, AGENTS)
    found = replace(camera, device="cuda").frames(drive.batch, drive.state, AGENTS)
    assert found.keys() == expected.keys()
    for channel, values in found.items():
        assert values.dtype == expected[channel].dtype and values.shape == expected[channel].shape
        assert share_alike(values, expected[channel]) >= 0.999, channel
        assert len(np.unique(values)) > 2, channel


def test_frames_are_handed_on_without_a_copy(drive):
    camera = Camera(16, 10, device="cuda", channels=("depth",), has_scenery=False)
    depth = camera.frames_on_card(drive.batch, drive.state, AGENTS)["depth"]
    before = depth.copy_to_host()
    if IS_SIMULATED:
        taken = np.from_dlpack(depth)
    else:
        torch = pytest.importorskip("torch")
        tensor = torch.from_dlpack(depth)
        assert tensor.is_cuda and torch.as_tensor(depth, device="cuda").data_ptr() == tensor.data_ptr()
        tensor[0, 0, 0] = 7.0
        torch.cuda.synchronize()
        taken = tensor.cpu().numpy()
    np.testing.assert_array_equal(taken.ravel()[1:], before.ravel()[1:])
    assert depth.copy_to_host()[0, 0, 0] == taken[0, 0, 0]
    if IS_SIMULATED:
        assert taken.ctypes.data == depth.array.__array_interface__["data"][0]


def test_observations_have_noise_and_several_rays_per_pixel(drive):
    camera = Camera(16, 10, device="cuda", supersampling=2, noise=3.0, has_scenery=False)
    observed = np.zeros((1, *camera.shape), np.uint8)
    camera.observe(drive.batch, drive.state, AGENTS, np.random.default_rng(0), observed)
    expected = replace(camera, device="cpu", noise=0.0).frames(drive.batch, drive.state, AGENTS)["rgb"]
    added = observed.astype(float) - expected
    assert 2.0 < added.std() < 4.0 and abs(added.mean()) < 1.0
