"""Figures of many scenarios: small multiples, profiles, distributions, comparisons, animations."""

from __future__ import annotations

import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from scenarionet_data import plots
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.plots.distributions import MEASURES, distributions
from scenarionet_data.plots.files import as_webp
from scenarionet_data.plots.profiles import profile
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

HOSTILE = "<script>alert(1)</script>/../$x$'; DROP TABLE metadata; --"


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Twenty scenarios of 2 to 21 objects; three contain only the ego, so their gap is undefined."""
    few = [make_drive(f"alone{number}", speed=5.0 + number) for number in range(3)]
    many = [make_scenario(number, num_objects=2 + number) for number in range(20)]
    lake = write_lake(tmp_path_factory.mktemp("plots") / "lake", [*few, *many])
    lake.filter("num_objects > 8", name="many")
    lake.filter("num_objects <= 8", name="few")
    lake.filter("scenario_id = 'made/v1/alone1'", name="one")
    return lake


def drawn(figure):
    """A figure's pixels (H, W, 3)."""
    file = io.BytesIO()
    figure.savefig(file, format="png")
    with Image.open(file) as picture:
        return np.asarray(picture.convert("RGB"))


def test_distribution_counts_every_scenario_once(lake):
    (all_of_them,) = distributions(lake, "num_objects")
    assert all_of_them.counts.sum() == len(lake)
    known = lake.sql("SELECT num_objects FROM metadata")["num_objects"].to_numpy()
    np.testing.assert_array_equal(all_of_them.counts, np.histogram(known, all_of_them.edges)[0])
    (width,) = set(np.diff(all_of_them.edges))
    assert width == round(width), "whole numbers have bins of whole numbers"
    (finer,) = distributions(lake, "num_objects", bins=60)
    np.testing.assert_array_equal(np.diff(finer.edges), 1.0)


def test_groups_share_bins_and_missing_values_are_counted(lake):
    parts = distributions(lake, "min_ego_gap", databases=["many", "few"])
    assert [part.name for part in parts] == ["many@1", "few@1"]
    np.testing.assert_array_equal(parts[0].edges, parts[1].edges)
    nulls = lake.sql("SELECT count(*) FROM metadata WHERE min_ego_gap IS NULL").item()
    assert nulls >= 3
    assert sum(part.missing for part in parts) == nulls
    assert sum(part.counts.sum() for part in parts) == len(lake) - nulls
    by_log = distributions(lake, "ego_distance", by="city")
    assert {part.name: int(part.counts.sum()) for part in by_log} == {"none": 3, "nowhere": 20}


@pytest.mark.long
def test_distributions_of_no_values_only_nan_and_one_value(lake, tmp_path):
    """NaN values are counted as missing, and their panel is drawn."""
    lake.tag_by_sql("strange", "SELECT scenario_id, 'nan'::DOUBLE AS value FROM metadata")
    strange = lake.refresh()
    (part,) = distributions(strange, strange_column(strange))
    assert (part.counts.sum(), part.missing) == (0, len(lake))
    drawn(plots.draw_distributions(strange, [strange_column(strange), "duration"]))
    drawn(plots.draw_distributions(lake, databases=["one"]))
    empty = lake.restrict_to([])
    with pytest.raises(BadParameter, match="no scenarios to draw"):
        plots.draw_distributions(empty)


def strange_column(lake):
    """Name of the user column."""
    return next(name for name in lake.sql("SELECT * FROM metadata LIMIT 0").columns if name.startswith("strange"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"columns": ["speed"]}, "no column 'speed'"),
        ({"columns": ['x"; DROP TABLE metadata; --']}, "no column"),
        ({"columns": ["scenario_id"]}, "holds no numbers"),
        ({"columns": ["timestamps"]}, "holds no numbers"),
        ({"by": "mood"}, "no column 'mood'"),
        ({"by": "scenario_id"}, "more than lines can be told apart"),
    ],
)
def test_invalid_columns_for_distributions_are_refused(lake, words, message):
    with pytest.raises(BadParameter, match=message):
        plots.draw_distributions(lake, **words)


def test_distributions_have_units_and_a_legend(lake):
    figure = plots.draw_distributions(lake, databases=["many", "few"])
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert len(labels) == len(MEASURES)
    assert {"ego_distance [m]", "ego_mean_speed [m/s]", "ego_cumulative_curvature [rad]"} <= set(labels)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["many@1", "few@1"]


@pytest.mark.long
def test_text_in_figures_does_not_overlap(lake):
    """Titles, labels and ticks of all panels of the comparison and of the distributions."""
    for figure in (plots.draw_distributions(lake), plots.draw_comparison(lake.compare("many", "few"))):
        drawn(figure)
        for first, second in pairwise(axes for axes in figure.axes if axes.get_visible()):
            assert not first.get_tightbbox().overlaps(second.get_tightbbox().shrunk(0.98, 0.98))


def test_profile_of_a_known_drive():
    """10 m/s straight ahead; the other object accelerates at 2 m/s² from the third timestep on."""
    scenario = make_drive(others=(Other(15.0, 3.5, vx=10.0, first=3),))
    tracks = scenario.tracks
    tracks.velocity[1, 3:, 0] = 10.0 + 0.2 * np.arange(38)
    ego, other = profile(scenario, "t0"), profile(scenario, "t1")
    np.testing.assert_allclose(ego.speed, 10.0)
    np.testing.assert_allclose(ego.acceleration, 0.0, atol=1e-5)
    np.testing.assert_allclose(ego.curvature, 0.0, atol=1e-6)
    assert np.isnan(other.speed[:3]).all()
    np.testing.assert_allclose(other.acceleration[4:], 2.0, rtol=1e-3)


def test_circle_has_its_curvature():
    scenario = make_drive(num_steps=50)
    time = scenario.timestamps
    angle = (10.0 / 20.0) * time  # 10 m/s on a radius of 20 m
    scenario.tracks.heading[0] = np.angle(np.exp(1j * angle))
    scenario.tracks.velocity[0] = 10.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(profile(scenario, "t0").curvature, 1 / 20.0, rtol=1e-3)


@pytest.mark.long
def test_profiles_of_one_timestep_are_drawn_and_unknown_objects_refused():
    scenario = make_scenario(4)
    figure = plots.draw_profiles(scenario, ["t0", "t1", "t2"])
    assert [axes.get_ylabel() for axes in figure.axes] == ["speed [m/s]", "acceleration\n[m/s²]", "curvature\n[1/m]"]
    assert "t0 (the ego)" in [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    drawn(figure)
    drawn(plots.draw_profiles(make_drive(num_steps=1)))
    with pytest.raises(BadParameter, match="no track 'nobody'"):
        plots.draw_profiles(scenario, ["nobody"])


def test_small_multiples():
    scenarios = [make_drive(str(number), num_steps=1 + 20 * number) for number in range(3)]
    figure = plots.small_multiples(scenarios, ["a", HOSTILE, "c"], timesteps=[0, None, 40], columns=2, width=40)
    assert [axes.get_visible() for axes in figure.axes] == [True, True, True, False]
    assert figure.axes[0].get_title(loc="left") == "a"
    drawn(figure)
    assert all(axes.get_legend() is None for axes in figure.axes)
    assert all(axes.get_legend() for axes in plots.small_multiples(scenarios, has_legend=True).axes)
    with pytest.raises(BadParameter, match="no scenarios to draw"):
        plots.small_multiples([])


@pytest.mark.parametrize("kind", ["mp4", "gif"])
def test_animation_plays_in_a_notebook(kind, tmp_path):
    if kind == "mp4":
        pytest.importorskip("av", reason="the extra `video` is not installed")
    scenario = replace(make_drive(num_steps=4), id=HOSTILE)
    animation = plots.animate(scenario, drawing=plots.Drawing(size=64), kind=kind)
    html = animation._repr_html_()
    assert f"data:{'video/mp4' if kind == 'mp4' else 'image/gif'};base64," in html
    assert "<script>" not in html
    animation.save(tmp_path / f"drive.{kind}")
    with pytest.raises(BadParameter, match=f"this animation is a {kind}"):
        animation.save(tmp_path / "drive.avi")
    with pytest.raises(BadParameter, match="mp4 and gif"):
        plots.animate(scenario, kind="avi")


@pytest.mark.long
def test_video_converts_to_animated_webp():
    video = plots.animate(make_drive(num_steps=60), drawing=plots.Drawing(size=64), kind="mp4")
    with Image.open(io.BytesIO(as_webp(video.content, rate=5.0, seconds=4.0))) as picture:
        assert (picture.n_frames, picture.size) == (20, (64, 64))
        picture.seek(19)
        picture.load()
        assert picture.info["duration"] == 200
        assert np.asarray(picture.convert("RGB")).std() > 10, "something is drawn"


def test_animation_falls_back_to_gif_without_mp4_writer(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    assert plots.animate(make_drive(num_steps=2), drawing=plots.Drawing(size=64)).kind == "gif"
    with pytest.raises(MissingDependency, match="video"):
        plots.animate(make_drive(num_steps=2), kind="mp4")


def test_a_video_without_pyav_names_the_extra_and_no_temporary_file(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    frames = [np.zeros((16, 16, 3), np.uint8)]
    with pytest.raises(MissingDependency, match=r"mp4 videos need PyAV: .*\[video\]") as caught:
        plots.write_video(tmp_path / "drive.mp4", frames, 10.0)
    assert "unfinished" not in str(caught.value)
    assert not list(tmp_path.iterdir())
