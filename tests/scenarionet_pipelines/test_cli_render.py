"""``scenarionet render``."""

from __future__ import annotations

import pytest
from PIL import Image

from scenarionet_data import Lake
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_image(lake, ok, as_json, tmp_path):
    text = ok("render", lake, "s000001", "-o", tmp_path / "s.png", "--size", "200", "--at", "1.5")
    assert "made/v1/s000001, 1 frame" in text
    with Image.open(tmp_path / "s.png") as picture:
        assert max(picture.size) == 200
    found = as_json("render", lake, "s000001", "-o", tmp_path / "s.png", "--size", "100", "--replace")
    assert found["scenario_id"] == "made/v1/s000001"
    assert found["bytes"] == (tmp_path / "s.png").stat().st_size


@pytest.mark.long
@pytest.mark.parametrize("view", ["camera", "chase", "cockpit", "orbit"])
def test_views_in_space(lake, ok, view, tmp_path):
    ok("render", lake, "s000001", "-o", tmp_path / "s.png", "--size", "128", "--view", view, "--weather", "dusk")
    with Image.open(tmp_path / "s.png") as picture:
        assert picture.size == (128, 72)
        assert len(picture.getcolors(1 << 16)) > 50
    wrong = run("render", lake, "s000001", "-o", tmp_path / "s.pdf", "--view", view)
    assert wrong.exit_code != 0 and ".png" in wrong.output


def test_video(lake, as_json, tmp_path):
    words = ("--size", "80", "--view", "all", "--speed", "2", "--quiet")
    assert as_json("render", lake, "s000001", "-o", tmp_path / "s.gif", *words)["frames"] == 31
    with Image.open(tmp_path / "s.gif") as video:
        assert video.info["duration"] == 50


def test_simulation_run_is_drawn(tmp_path, ok, as_json):
    """A car that keeps its speed, drawn where it drove and not where it was recorded."""
    lake = write_lake(tmp_path / "lake", [make_drive(num_steps=12)]).root
    ok("filter", lake, "--where", "true", "--name", "all")
    ok("sim", lake, "all", "--policy", "constant", "--backend", "kinematic", "--name", "straight_on", "--quiet")
    words = ("--size", "64", "--run", "straight_on", "--quiet")
    frames = as_json("render", lake, "drive", "-o", tmp_path / "s.gif", *words)["frames"]
    (steps,) = Lake(lake).sql("SELECT len(x) AS n FROM rollouts")["n"]
    assert frames == steps
    missing = run("render", lake, "drive", "-o", tmp_path / "s.png", "--run", "other")
    assert missing.exit_code == 2
    assert "runs in this lake: straight_on" in missing.stderr


def test_films_of_all_failures(tmp_path, ok, as_json):
    """Constant velocity drives through a car that stands 15 m ahead in one of two scenarios."""
    drives = [make_drive("crash", num_steps=21, others=(Other(15.0),)), make_drive("free", num_steps=21)]
    lake = write_lake(tmp_path / "lake", drives).root
    ok("sim", lake, "--policy", "constant", "--name", "on", "--no-references", "--quiet")
    words = ("runs", "films", lake, "on", "-o", tmp_path / "films", "--format", "gif", "--size", "80", "--quiet")
    assert as_json(*words, "--where", "crashed")["made"] == 1
    (film,) = (tmp_path / "films").iterdir()
    assert film.name == "made_v1_crash.gif"
    with Image.open(film) as video:
        assert video.n_frames > 20
    assert as_json(*words, "--where", "crashed")["made"] == 0, "what is there is not made again"
    missing = run("runs", "films", lake, "other", "-o", tmp_path / "films")
    assert missing.exit_code == 2 and "no run 'other' in this lake; there are: on" in missing.stderr


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("s000001", "-o", "s.bmp"), 2, "ends with one of"),
        (("s000001", "-o", "there.png"), 2, "--replace"),
        (("nobody", "-o", "s.png"), 1, "no one scenario 'nobody'"),
        (("s000001", "-o", "s.png", "--at", "99"), 2, "--at 99: wanted 0 to 3 s"),
        (
            ("s000001", "-o", "s.gif", "--at", "1"),
            2,
            "--at 1: s.gif is a video, which has all times; a picture is a .png",
        ),
        (("s000001", "-o", "s.png", "--at", "nan"), 2, "nan is not a finite number"),
        (("s000001", "-o", "s.png", "--speed", "inf"), 2, "inf is not a finite number"),
    ],
)
def test_errors_are_reported(lake, tmp_path, monkeypatch, words, code, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.png").touch()
    result = run("render", lake, *words)
    assert result.exit_code == code
    assert message in result.stderr


def test_tracks_coloured_by_speed(lake, ok, tmp_path):
    ok("render", lake, "s000001", "-o", tmp_path / "plain.png", "--size", "200", "--quiet")
    ok("render", lake, "s000001", "-o", tmp_path / "speed.png", "--size", "200", "--color-by", "speed", "--quiet")
    assert (tmp_path / "plain.png").read_bytes() != (tmp_path / "speed.png").read_bytes()


def test_show_draws_an_image_next_to_the_properties(lake, as_json, tmp_path):
    facts = as_json("show", lake, "s000001", "--picture", tmp_path / "s.svg")
    assert facts["scenario_id"] == "made/v1/s000001"
    assert (tmp_path / "s.svg").read_bytes().startswith(b"<?xml")
    again = run("show", lake, "s000001", "--picture", tmp_path / "s.svg")
    assert again.exit_code == 2
    assert "--replace" in again.stderr
    assert run("show", lake, "s000001", "--picture", tmp_path / "s.mp4").exit_code == 2


@pytest.mark.parametrize("words", ["'; DROP TABLE metadata; --", "../../etc/passwd", "<script>alert(1)</script>", "%"])
def test_hostile_ids_are_unknown_scenarios(lake, tmp_path, words):
    for command in (("show", lake, words), ("render", lake, words, "-o", tmp_path / "s.png")):
        result = run(*command)
        assert result.exit_code == 1
        assert "no one scenario" in result.stderr
    assert list(tmp_path.glob("*.png")) == []
