"""Pictures of generated roads against stored ones; ``python -m tests.scenarionet_sim.cameras.test_golden_pictures``
writes them anew after a change of looks that was wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scenarionet_sim.cameras import drawing
from scenarionet_sim.cameras.classes import SemanticClass
from scenarionet_sim.cameras.meshes.library import library
from scenarionet_sim.cameras.weather import DAY, DUSK, RAIN
from scenarionet_sim.sensors.camera import Camera
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import generated, simulate

FOLDER = Path(__file__).parent / "pictures"
CAMERAS = {
    "day": Camera(192, 108, weather=DAY),
    "dusk": Camera(192, 108, weather=DUSK, own="inside"),
    "rain": Camera(192, 108, weather=RAIN, lens="fisheye", fov=2.4),
}


def similarity(first, second):
    """Mean structural similarity of grey pictures in windows of 7 x 7 pixels (Wang et al. 2004)."""
    a, b = (
        np.lib.stride_tricks.sliding_window_view(picture.astype(np.float64).mean(axis=-1), (7, 7)).reshape(-1, 49)
        for picture in (first, second)
    )
    mean_a, mean_b = a.mean(axis=1), b.mean(axis=1)
    both = ((a - mean_a[:, None]) * (b - mean_b[:, None])).mean(axis=1)
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    share = (2 * mean_a * mean_b + c1) * (2 * both + c2)
    share /= (mean_a**2 + mean_b**2 + c1) * (a.var(axis=1) + b.var(axis=1) + c2)
    return share.mean()


def picture(name):
    others = Other(14.0, 1.0, vx=6.0), Other(22.0, 3.5, vx=3.0), Other(9.0, -4.5, vx=1.0)
    drive = simulate(make_drive(speed=8.0, others=others, red=True), steps=0)
    return CAMERAS[name].frames(drive.batch, drive.state, np.array([[0, 0]], np.int32))["rgb"][0]


@pytest.mark.parametrize("name", CAMERAS)
def test_pictures_look_like_the_stored_ones(name):
    stored = np.array(Image.open(FOLDER / f"{name}.png"))
    found = picture(name)
    assert similarity(found, stored) >= 0.99
    assert np.abs(found.astype(int) - stored).mean() < 1.0
    assert similarity(found, np.roll(stored, 2, axis=1)) < 0.99


def test_outlines_cover_the_pixels_of_their_meshes(monkeypatch):
    street = simulate(generated(7))
    camera, agents = Camera(84, 84, channels=("rgb", "depth", "semantic")), street.agents[:1]
    outlines = camera.frames(street.batch, street.state, agents)
    meshes = library()
    without = meshes._replace(outlines=np.zeros_like(meshes.outlines))
    monkeypatch.setattr(drawing, "library", lambda: without)
    whole = camera.frames(street.batch, street.state, agents)
    is_same = outlines["semantic"] == whole["semantic"]
    assert 0.99 < is_same.mean() < 1.0
    assert similarity(outlines["rgb"][0], whole["rgb"][0]) >= 0.99
    is_tree = is_same & (whole["semantic"] == SemanticClass.VEGETATION)
    assert (np.abs(outlines["depth"] / whole["depth"] - 1.0)[is_tree] < 0.05).mean() > 0.95


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for each in CAMERAS:
        Image.fromarray(picture(each)).save(FOLDER / f"{each}.png", optimize=True)
