"""Frames, pictures and videos: what is where in them, and on disk."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.render import Drawing, Live, Moment, TopDown, Window, write_picture, write_video
from scenarionet_sim.render.palette import EGO, GROUND, OBJECTS, ROAD, object_color
from scenarionet_sim.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import alone, generated

ROOT = Path(__file__).parents[3]


def color(name):
    return np.round(np.array(to_rgb(name)) * 255).astype(int)


def pixel(view, picture, x, y, center):
    """The colour of a place [m] in a frame whose middle is ``center``."""
    height, width = picture.shape[:2]
    column = int(width / 2 + (x - center[0]) * view.scale)
    row = int(height / 2 - (y - center[1]) * view.scale)
    return picture[row, column].astype(int)


@pytest.fixture(scope="module")
def world():
    return World.from_scenario(make_drive(others=(Other(15.0, 3.5, vx=10.0),), red=True))


def recorded(world, end):
    return [Moment.recorded(world, timestep) for timestep in range(end)]


def test_everything_is_where_it_is(world):
    """Grass, road, the ego's rear and the other car's; the frame's middle is the ego."""
    view = TopDown(world, Window(0, 0, 60, 40), size=600)
    picture = view.frame(recorded(world, 1))
    assert picture.shape == (400, 600, 3)
    places = {(0, -15): GROUND, (-10, 3.5): ROAD, (-1.8, 0): EGO, (13.5, 3.5): object_color(1)}
    for (x, y), name in places.items():
        np.testing.assert_allclose(pixel(view, picture, x, y, (0, 0)), color(name), atol=3, err_msg=f"{x}, {y}")


def test_the_frame_moves_with_the_ego_or_stays(world):
    now = recorded(world, 11)  # the ego is at x = 10
    moving, still = (TopDown(world, Window(0, 0, 60, 40), size=600, follows=follows) for follows in (True, False))
    np.testing.assert_allclose(pixel(moving, moving.frame(now), 8.2, 0, (10, 0)), color(EGO), atol=3)
    np.testing.assert_allclose(pixel(still, still.frame(now), 8.2, 0, (0, 0)), color(EGO), atol=3)


def test_a_map_of_tiles_has_no_seams(world):
    """Moved by 37 pixels the map is the same, across the borders of tiles."""
    empty = recorded(world, 1)[0]
    nobody = Moment(0, empty.position, empty.heading, np.zeros_like(empty.present))
    frames = []
    for shift in (0, 37):
        view = TopDown(world, Window(shift / 10, 0, 120, 30), size=1200, follows=False)
        frames.append(view.frame([nobody])[60:240].astype(int))  # between the words
    assert np.abs(frames[0][:, 37:] - frames[1][:, :-37]).max() <= 2


def test_frames_can_be_taken_in_any_order(world):
    view = TopDown(world, Window(0, 0, 60, 40), size=300)
    first = view.frame(recorded(world, 1))
    view.frame(recorded(world, 30))
    np.testing.assert_array_equal(view.frame(recorded(world, 1)), first)


def test_live_pictures_have_trails_until_the_next_episode():
    simulation = Simulation([World.from_scenario(make_drive())])
    live = Live(width=40, size=200)
    first = live.picture(simulation.stage.worlds[0], simulation.state)
    for _ in range(5):
        simulation.step([[0.0, 0.5]])
        later = live.picture(simulation.stage.worlds[0], simulation.state)
    assert not np.array_equal(first, later)
    simulation.reset(0)
    np.testing.assert_array_equal(live.picture(simulation.stage.worlds[0], simulation.state), first)
    simulation.reset(0, World.from_scenario(alone(has_map=False)))
    assert not np.array_equal(live.picture(simulation.stage.worlds[0], simulation.state), first)


def test_a_window_needs_a_display(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    import matplotlib

    matplotlib.use("agg")
    with pytest.raises(BadParameter, match="rgb_array"):
        Live().show(np.zeros((8, 8, 3), np.uint8))


@pytest.mark.parametrize("ending", [".png", ".pdf", ".svg"])
def test_pictures(world, tmp_path, ending):
    path = tmp_path / "deeper" / f"scenario{ending}"
    write_picture(path, world, recorded(world, 5), size=400)
    assert path.stat().st_size > 5000
    if ending == ".png":
        with Image.open(path) as picture:
            assert max(picture.size) == 400
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_generated_scenario_shows_all_its_colours(tmp_path):
    world = World.from_scenario(generated(3))
    write_picture(tmp_path / "s.png", world, recorded(world, 100), size=700)
    with Image.open(tmp_path / "s.png") as file:
        picture = np.asarray(file.convert("RGB")).astype(int)
    for name in (GROUND, ROAD, EGO, OBJECTS[1]):
        assert (np.abs(picture - color(name)).max(axis=2) <= 3).sum() > 50, name


@pytest.mark.parametrize("has_map", [True, False])
@pytest.mark.parametrize("view", ["route", "ego", "all"])
def test_one_object_with_and_without_a_map(tmp_path, has_map, view):
    world = World.from_scenario(alone(has_map=has_map))
    assert Drawing(view, size=120).save(tmp_path / "s.png", world, recorded(world, 3)) == 1


def test_videos_hold_every_moment(world, tmp_path):
    moments, done = recorded(world, 7), []
    drawing = Drawing(size=160, width=50)
    assert drawing.save(tmp_path / "s.gif", world, moments, on_frame=done.append) == 7
    assert done == list(range(7))
    with Image.open(tmp_path / "s.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["duration"]) == (7, (160, 160), 100)


def test_mp4(world, tmp_path):
    av = pytest.importorskip("av")
    Drawing(size=160, width=50, speed=2.0).save(tmp_path / "s.mp4", world, recorded(world, 7))
    with av.open(str(tmp_path / "s.mp4")) as video:
        assert video.streams.video[0].average_rate == 20
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(frames) == 7
    exact = TopDown(world, Window(0, 0, 50, 50), size=160).frame(recorded(world, 1)).astype(int)
    assert np.abs(frames[0].astype(int) - exact).mean() < 6


def test_what_is_missing_is_named(world, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[video\]"):
        Drawing(size=64).save(tmp_path / "s.mp4", world, recorded(world, 2))
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_extra_is_named():
    code = "import sys; sys.modules['matplotlib'] = None; import scenarionet_sim.render"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "install scenarionet-lake[plots]" in done.stderr


def test_a_video_that_fails_leaves_nothing(tmp_path):
    def frames():
        yield np.zeros((16, 16, 3), np.uint8)
        raise RuntimeError("the simulation broke")

    with pytest.raises(RuntimeError, match="broke"):
        write_video(tmp_path / "s.gif", frames(), 10)
    assert list(tmp_path.iterdir()) == []


def test_bad_words(world, tmp_path):
    moments = recorded(world, 2)
    with pytest.raises(BadParameter, match=r"\.png, \.pdf, \.svg, \.gif, \.mp4"):
        Drawing().save(tmp_path / "s.bmp", world, moments)
    with pytest.raises(BadParameter, match="route, ego, all"):
        Drawing("sky").save(tmp_path / "s.png", world, moments)
    with pytest.raises(BadParameter, match="ends with one of"):
        write_picture(tmp_path / "s.gif", world, moments)
    with pytest.raises(BadParameter, match="wider and higher"):
        Window(0, 0, 0, 10)
