"""Every channel of pictures of a street; ``sensors/test_camera.py`` compares them with oracles."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.cameras.channels import CHANNELS
from scenarionet_sim.cameras.classes import SemanticClass
from scenarionet_sim.sensors.camera import Camera, Mount
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate

WIDTH, HEIGHT, FOCAL = 192, 108, 120.0
TOLERANCE = {"rgb": 1, "depth": 1e-3, "semantic": 0, "instance": 0, "normals": 1e-4, "flow": 1e-3}


def camera(name, first=0, width=WIDTH):
    """A camera for some columns of a picture."""
    intrinsics = FOCAL, FOCAL, WIDTH / 2 - first, HEIGHT / 2
    mount = Mount(1.0, 0.2, 1.6, 0.15, -0.12)
    return Camera(width, HEIGHT, intrinsics=intrinsics, channels=(name,), mount=mount, has_scenery=False)


@pytest.fixture(scope="module")
def street():
    return simulate(make_drive(speed=8.0, others=(Other(6.5, 0.8, vx=6.0), Other(9.0, -4.5, vx=1.0))), steps=3)


def seen(camera, street):
    return next(iter(camera.frames(street.batch, street.state, np.array([[0, 0]], np.int32)).values()))[0]


@pytest.fixture(scope="module")
def on_objects(street):
    return seen(camera("instance"), street) > 0


@pytest.mark.parametrize("name", CHANNELS)
def test_columns_of_a_picture_are_those_of_a_narrow_camera(name, street, on_objects):
    """A narrow camera has no long runs of pixels on one triangle: colours there do not come from steps along a row."""
    whole = seen(camera(name), street).astype(np.float64)
    assert len(np.unique(whole)) > 1
    for first in range(0, WIDTH, 32):
        part = seen(camera(name, first, 4), street).astype(np.float64)
        here = on_objects[:, first : first + 4]
        off = np.abs(part - whole[:, first : first + 4])[here]
        assert off.size == 0 or off.max() <= TOLERANCE[name]
    assert on_objects[:, ::32].sum() > 100


def test_channels_agree_on_where_objects_are(street, on_objects):
    semantic, depth = seen(camera("semantic"), street), seen(camera("depth"), street)
    normals, flow = seen(camera("normals"), street), seen(camera("flow"), street)
    assert set(np.unique(semantic[on_objects])) == {SemanticClass.CAR}
    assert depth[on_objects].max() < 14.0 < depth[semantic == SemanticClass.SKY].min()
    np.testing.assert_allclose(np.linalg.norm(normals[on_objects], axis=-1), 1.0, atol=1e-3)
    assert not normals[semantic == SemanticClass.SKY].any()
    assert np.isfinite(flow).all() and np.abs(flow[on_objects]).max() > 0.5
