"""Examples that learn from pictures: exact labels, a network that learns, programs that run."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

import camera_driver  # noqa: E402
import lane_pose  # noqa: E402
from click.testing import CliRunner  # noqa: E402
from driving_pictures import AHEAD, CAMERA, collect, fit  # noqa: E402


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """Pictures on straight roads of one lane per direction."""
    lake = tmp_path_factory.mktemp("straight") / "lake"
    options = {"blocks": "straight=1", "num_blocks": 1, "density": 0, "max_lanes": 1, "construction": 0}
    convert("pg", "0:3", lake, options=options)
    Lake(lake).filter("true", name="all")
    return lake, collect(ScenarioLoader(lake), range(3), every=12)


def test_labels_are_exact_on_straight_roads(straight):
    _, seen = straight
    assert len(seen) > 10 and seen.views.shape == (len(seen), 2, *CAMERA.shape) and set(seen.scenario) == {0, 1, 2}
    ahead = -np.sin(seen.turn) * AHEAD - np.cos(seen.turn) * seen.offset
    assert np.mean(np.abs(seen.side - ahead) < 0.02) > 0.8  # near the end of a path, the point is its end
    assert np.abs(seen.offset).max() <= 1.5 and np.abs(seen.wanted - seen.speed).max() < 4.0


def test_the_camera_sees_its_place(straight):
    """From the left of the path, the yellow lines in the middle of the road are farther right in the picture."""
    _, seen = straight
    colours = seen.views[:, 1, 30:].astype(float)
    yellow = (colours[..., 0] - colours[..., 2] > 40) & (colours[..., 1] > 100)
    columns = [np.nonzero(picture)[1].mean() if picture.any() else np.nan for picture in yellow]
    is_straight = (np.abs(seen.turn) < 0.08) & np.isfinite(columns)
    assert np.corrcoef(np.array(columns)[is_straight], seen.offset[is_straight])[0, 1] > 0.8


def test_the_network_learns_where_a_bar_is():
    rng = np.random.default_rng(0)
    places = rng.integers(10, 70, 256)
    views = np.zeros((256, 1, *CAMERA.shape), np.uint8)
    for view, place in zip(views, places.tolist(), strict=True):
        view[:, :, place : place + 4] = 255
    wanted = places[:, None].astype(np.float32)
    network = fit(views[:200], wanted[:200], passes=12)
    with torch.no_grad():
        missed = np.abs(network(torch.from_numpy(views[200:])).numpy() - wanted[200:]).mean()
    assert missed < 0.25 * np.abs(wanted[200:] - wanted[:200].mean()).mean()


def test_controls_steer_to_the_point_and_reach_the_speed():
    found = camera_driver.controls(np.array([[0.0, 8.0, 8.0], [1.0, 8.0, 10.0], [-1.0, 8.0, 4.0]], np.float32))
    assert found[0].tolist() == [0.0, 0.0]
    assert found[1, 0] == -found[2, 0] > 0.0
    assert found[1:, 1].tolist() == [0.5, -0.5]  # 2 of 4 m/s², 4 of 8 m/s²


@pytest.mark.parametrize("program", [lane_pose.main, camera_driver.main])
def test_programs(straight, program):
    words = [str(straight[0]), "all", "all", "--passes", "1", "--every", "30"]
    done = CliRunner().invoke(program, words, catch_exceptions=False)
    assert done.exit_code == 0 and ("offset" in done.output or "blind" in done.output)
