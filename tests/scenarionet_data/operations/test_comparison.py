"""Statistics of databases, checked against hand-computed values, and their plot."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, DatabaseNotFound
from scenarionet_data.plots import write_comparison
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    made = [make_scenario(seed, num_objects=3 + seed, num_lights=seed % 2, num_steps=12) for seed in range(6)]
    lake = write_lake(tmp_path_factory.mktemp("comparison"), made)
    lake.filter("num_objects >= 5", name="large")
    lake.filter("num_objects < 5", name="small")
    lake.filter("false", name="none", allow_empty=True)
    return lake


def test_statistics_are_mean_and_standard_deviation_over_members(lake):
    rows = lake.sql("SELECT * FROM metadata WHERE num_objects >= 5")
    small, large = lake.compare("small", "large")
    assert (small.name, large.name) == ("small@1", "large@1")
    assert (small.count + large.count, large.count) == (6, len(rows))
    found = {measure.measure: measure for measure in large.measures}
    columns = {"track length": "ego_distance", "vehicles": "num_vehicles", "pedestrians": "num_pedestrians"}
    for name, column in columns.items():
        values = rows[column].to_numpy().astype(np.float64)
        measure = found[name]
        assert measure.scenarios == len(rows)
        wanted = (values.mean(), values.std(ddof=1), values.min(), values.max())
        assert (measure.mean, measure.std, measure.min, measure.max) == pytest.approx(wanted)
    for name, column in {"intersection": "has_intersection", "construction": "has_construction"}.items():
        assert found[f"{name} ratio"].mean == pytest.approx(rows[column].mean())
        assert found[f"{name} ratio"].std is None
    assert found["traffic light ratio"].mean == pytest.approx((rows["num_lights"] > 0).mean())
    assert [m.measure for m in small.measures] == [m.measure for m in large.measures]


def test_statistics_of_the_whole_lake_and_of_an_empty_database(lake):
    (whole,) = lake.compare()
    assert (whole.name, whole.count) == ("lake", 6)
    (none,) = lake.compare("none")
    assert (none.count, none.measures) == (0, ())
    with pytest.raises(DatabaseNotFound, match="large"):
        lake.compare("huge")


@pytest.mark.long
@pytest.mark.parametrize(("suffix", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_plot_is_drawn(lake, suffix, begins, tmp_path):
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    path = tmp_path / f"stats.{suffix}"
    write_comparison(lake.compare("small", "none", "large"), path)
    content = path.read_bytes()
    assert content.startswith(begins)
    if suffix == "svg":  # texts are drawn as glyphs; the words are kept as comments
        assert b"large@1 (" in content
        assert b"none@1" not in content


def test_invalid_plot_arguments_are_refused(lake, tmp_path):
    with pytest.raises(BadParameter, match=r"\.png, \.pdf, \.svg"):
        write_comparison(lake.compare(), tmp_path / "stats.docx")
    with pytest.raises(BadParameter, match="no scenarios to draw"):
        write_comparison(lake.compare("none"), tmp_path / "stats.png")
