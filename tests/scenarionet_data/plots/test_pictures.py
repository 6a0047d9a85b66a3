"""Frames, images and videos: expected colours at known places, and files on disk."""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.plots import (
    Drawing,
    Moment,
    Scene,
    TopDown,
    Window,
    draw_scenario,
    scenario_figure,
    thumbnail,
    write_figure,
    write_video,
)
from scenarionet_data.plots.palette import EGO, GROUND, LIGHTS, OBJECTS, ROAD, object_color
from scenarionet_data.scenario.vocabulary import LightColor, LightState
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import alone, generated
from tests.fixtures.towns import make_town

ROOT = Path(__file__).parents[3]


def color(name):
    return np.round(np.array(to_rgb(name)) * 255).astype(int)


def pixel(view, picture, x, y, center):
    """The colour of a place [m] in a frame centred on ``center``."""
    height, width = picture.shape[:2]
    column = int(width / 2 + (x - center[0]) * view.scale)
    row = int(height / 2 - (y - center[1]) * view.scale)
    return picture[row, column].astype(int)


@pytest.fixture(scope="module")
def scene():
    return Scene.of(make_drive(others=(Other(15.0, 3.5, vx=10.0),), red=True))


def recorded(scene, end):
    return [scene.moment(timestep) for timestep in range(end)]


def test_pixels_show_the_expected_objects(scene):
    """Grass, road, the ego's rear and the other car's; the frame is centred on the ego."""
    view = TopDown(scene, Window(0, 0, 60, 40), size=600)
    picture = view.frame(recorded(scene, 1))
    assert picture.shape == (400, 600, 3)
    places = {(0, -15): GROUND, (-10, 3.5): ROAD, (-1.8, 0): EGO, (13.5, 3.5): object_color(1)}
    for (x, y), name in places.items():
        np.testing.assert_allclose(pixel(view, picture, x, y, (0, 0)), color(name), atol=3, err_msg=f"{x}, {y}")


def test_frame_follows_the_ego_or_is_fixed(scene):
    now = recorded(scene, 11)  # the ego is at x = 10
    moving, still = (TopDown(scene, Window(0, 0, 60, 40), size=600, follows=follows) for follows in (True, False))
    np.testing.assert_allclose(pixel(moving, moving.frame(now), 8.2, 0, (10, 0)), color(EGO), atol=3)
    np.testing.assert_allclose(pixel(still, still.frame(now), 8.2, 0, (0, 0)), color(EGO), atol=3)


def test_tiled_map_has_no_seams(scene):
    """Moved by 37 pixels the map is the same, across tile borders."""
    empty = recorded(scene, 1)[0]
    nobody = Moment(0, empty.position, empty.heading, np.zeros_like(empty.present))
    frames = []
    for shift in (0, 37):
        view = TopDown(scene, Window(shift / 10, 0, 120, 30), size=1200, follows=False)
        frames.append(view.frame([nobody])[60:240].astype(int))  # between the texts
    assert np.abs(frames[0][:, 37:] - frames[1][:, :-37]).max() <= 2


def test_frames_can_be_rendered_in_any_order(scene):
    view = TopDown(scene, Window(0, 0, 60, 40), size=300)
    first = view.frame(recorded(scene, 1))
    view.frame(recorded(scene, 30))
    np.testing.assert_array_equal(view.frame(recorded(scene, 1)), first)


@pytest.mark.parametrize("ending", [".png", ".pdf", ".svg"])
def test_images(scene, tmp_path, ending):
    path = tmp_path / "deeper" / f"scenario{ending}"
    Drawing(size=400).save(path, scene, recorded(scene, 5))
    assert path.stat().st_size > 5000
    if ending == ".png":
        with Image.open(path) as picture:
            assert max(picture.size) == 400
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_generated_scenario_shows_all_its_colours(tmp_path):
    scene = Scene.of(generated(3))
    Drawing(size=700).save(tmp_path / "s.png", scene, now=100)
    with Image.open(tmp_path / "s.png") as file:
        picture = np.asarray(file.convert("RGB")).astype(int)
    for name in (GROUND, ROAD, EGO, OBJECTS[1]):
        assert (np.abs(picture - color(name)).max(axis=2) <= 3).sum() > 50, name


@pytest.mark.parametrize("has_map", [True, False])
@pytest.mark.parametrize("view", ["route", "ego", "all"])
def test_single_object_with_and_without_a_map(tmp_path, has_map, view):
    scene = Scene.of(alone(has_map=has_map))
    assert Drawing(view, size=120).save(tmp_path / "s.png", scene, recorded(scene, 3)) == 1


def test_videos_contain_every_timestep(scene, tmp_path):
    moments, done = recorded(scene, 7), []
    drawing = Drawing(size=160, width=50)
    assert drawing.save(tmp_path / "s.gif", scene, moments, on_frame=done.append) == 7
    assert done == list(range(7))
    with Image.open(tmp_path / "s.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["duration"]) == (7, (160, 160), 100)


def test_gif_keeps_colours_that_appear_later(tmp_path):
    """The light is green in the first frame and red in the second."""
    scenario = make_drive(red=True, num_steps=2)
    scenario.lights.state[0, 0] = LightState.TRAFFIC_LIGHT_GREEN
    Drawing(size=300, width=60).save(tmp_path / "s.gif", scenario)
    with Image.open(tmp_path / "s.gif") as gif:
        for frame, light in enumerate((LightColor.GREEN, LightColor.RED)):
            gif.seek(frame)
            picture = np.asarray(gif.convert("RGB")).astype(int)
            is_light = np.abs(picture - color(LIGHTS[light][0])).max(axis=2) <= 3
            assert is_light.sum() > 10, light


def test_mp4(scene, tmp_path):
    av = pytest.importorskip("av")
    Drawing(size=160, width=50, speed=2.0).save(tmp_path / "s.mp4", scene, recorded(scene, 7))
    with av.open(str(tmp_path / "s.mp4")) as video:
        assert video.streams.video[0].average_rate == 20
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) == 7
    exact = TopDown(scene, Window(0, 0, 50, 50), size=160).frame(recorded(scene, 1)).astype(int)
    assert np.abs(frames[0].astype(int) - exact).mean() < 6


def test_missing_packages_are_named(scene, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[video\]"):
        Drawing(size=64).save(tmp_path / "s.mp4", scene, recorded(scene, 2))
    assert list(tmp_path.iterdir()) == []


def test_missing_matplotlib_error_names_the_extra():
    code = "import sys; sys.modules['matplotlib'] = None; from scenarionet_data.plots import draw_scenario"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "pip install 'scenarionet-lake[plots]', or in a checkout pip install -e '.[plots]'" in done.stderr


def test_failed_video_leaves_no_file(tmp_path):
    def frames():
        yield np.zeros((16, 16, 3), np.uint8)
        raise RuntimeError("the simulation broke")

    with pytest.raises(RuntimeError, match="broke"):
        write_video(tmp_path / "s.gif", frames(), 10)
    assert list(tmp_path.iterdir()) == []


def test_invalid_parameters_are_rejected(scene, tmp_path):
    moments = recorded(scene, 2)
    with pytest.raises(BadParameter, match=r"\.png, \.pdf, \.svg, \.gif, \.mp4"):
        Drawing().save(tmp_path / "s.bmp", scene, moments)
    with pytest.raises(BadParameter, match="route, ego, all"):
        Drawing("sky").save(tmp_path / "s.png", scene, moments)
    with pytest.raises(BadParameter, match="ends with one of"):
        write_figure(tmp_path / "s.gif", scenario_figure(scene))
    with pytest.raises(BadParameter, match="must be positive"):
        Window(0, 0, 0, 10)


@pytest.mark.parametrize("size", [(240, 180), (64, 64), (400, 100)])
def test_thumbnails_fill_their_size_and_show_the_ego(scene, size):
    with Image.open(io.BytesIO(thumbnail(scene, size))) as file:
        assert (file.format, file.size) == ("PNG", size)
        picture = np.asarray(file).astype(int)
    is_ego = np.abs(picture - color(EGO)).max(axis=2) <= 3
    assert is_ego.sum() >= 8
    columns = np.flatnonzero(is_ego.any(axis=0))
    assert np.ptp(columns) + 1 >= 7, "so long that it is seen"


@pytest.mark.parametrize("color_by", ["time", "speed"])
def test_tracks_are_coloured_by_a_value_with_its_unit(scene, color_by):
    figure = scenario_figure(scene, 20, size=300, color_by=color_by, view="all")
    axes = figure.axes[0]
    (lines,) = [artist for artist in axes.collections if artist.get_array() is not None]
    values = {"time": np.arange(1, 41) * 0.1, "speed": np.full(40, 10.0)}[color_by]
    np.testing.assert_allclose(lines.get_array()[-40:], values, rtol=1e-5)  # the ego's are drawn last, on top
    (bar,) = figure.axes[1].child_axes
    assert bar.get_xlabel() == {"time": "time [s]", "speed": "speed [m/s]"}[color_by]
    figure.canvas.draw()


def test_drawing_on_user_axes_changes_only_these_axes(scene):
    before = dict(matplotlib.rcParams)
    figure = Figure(figsize=(6, 3), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_scenario(left, scene, 0, has_legend=False)
    draw_scenario(right, scene, 20, view="ego", width=30)
    figure.savefig(io.BytesIO(), format="svg")
    assert left.get_legend() is None
    assert [text.get_text() for text in right.get_legend().get_texts()] == ["ego", "its route", "vehicle", "red light"]
    np.testing.assert_allclose(right.get_xlim(), (20 - 15, 20 + 15), atol=1e-5)
    assert dict(matplotlib.rcParams) == before
    assert "matplotlib.pyplot" not in sys.modules or not matplotlib.pyplot.get_fignums()


@pytest.mark.parametrize(
    ("words", "message"),
    [({"timestep": 41}, "0 to 40"), ({"timestep": -1}, "no timestep -1"), ({"color_by": "mood"}, "time, speed")],
)
def test_invalid_drawings_are_rejected(scene, words, message):
    with pytest.raises(BadParameter, match=message):
        scenario_figure(scene, **words)


@pytest.mark.long
def test_ten_thousand_features_are_drawn(tmp_path):
    """Dashes, double lines, lanes and crosswalks."""
    scenario = replace(make_drive(), map=make_town(10_000))
    Drawing(size=600, view="all").save(tmp_path / "town.png", scenario, now=10)
    with Image.open(tmp_path / "town.png") as picture:
        assert len(picture.convert("RGB").getcolors(1 << 20)) > 4
    assert len(thumbnail(scenario)) > 2_000
