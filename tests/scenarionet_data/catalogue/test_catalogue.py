"""A catalogue: its tables, figures and pack, on scenarios whose disturbances are known."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import duckdb
import numpy as np
import pytest

from scenarionet_data.catalogue import FIGURES, compare_catalogue, compute_figures, gather_catalogue, write_catalogue
from scenarionet_data.catalogue.figures import definition_texts
from scenarionet_data.catalogue.gathering import PARAMETERS
from scenarionet_data.catalogue.packing import FILE
from scenarionet_data.errors import BadParameter, EmptyResult, ScenarioNotFound
from scenarionet_data.query.named_sql import CATALOGUE, DISTURBANCES
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.planted import KINDS, Noise, planted

pytestmark = pytest.mark.integration

SCENARIOS, TRUTHS = planted(["cut_in", "cut_in", "cut_out", "none"], 5, Noise())


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("catalogue") / "lake", SCENARIOS)


@pytest.fixture(scope="module")
def catalogue(lake):
    return gather_catalogue(lake)


def hidden(scenario, row, steps):
    """The scenario with a track that is not observed at some timesteps."""
    valid = scenario.tracks.valid.copy()
    valid[row, steps] = False
    arrays = {
        name: np.where(valid.reshape(valid.shape + (1,) * (each.ndim - 2)), each, 0).astype(each.dtype)
        for name, each in (("position", scenario.tracks.position), ("velocity", scenario.tracks.velocity))
    }
    heading = np.where(valid, scenario.tracks.heading, 0).astype(np.float32)
    size = np.where(valid[..., None], scenario.tracks.size, 0).astype(np.float32)
    tracks = replace(scenario.tracks, valid=valid, heading=heading, size=size, **arrays)
    return replace(scenario, tracks=tracks)


def test_exposure_is_what_the_egos_drove(lake, catalogue):
    (meters, seconds) = lake.sql("SELECT sum(ego_distance), sum(duration) FROM metadata").row(0)
    exposure = catalogue.exposure.to_pydict()
    assert sum(exposure["meters"]) == pytest.approx(meters, rel=1e-3)
    assert sum(exposure["seconds"]) == pytest.approx(seconds, rel=1e-6)
    assert set(exposure["road"]) == {"road"}


def test_rates_count_every_definition_with_its_interval(lake, catalogue):
    rates = [row for row in compute_figures(lake, catalogue)["rates"].rows if row["dataset"] == "all"]
    assert {row["definition"]: row["occurrences"] for row in rates} == {
        "acceleration": 0, "cut_in": 2, "cut_out": 1, "deceleration": 0,
    }  # fmt: skip
    for row in rates:
        assert row["per_hour"] == pytest.approx(row["occurrences"] / (4 * 14.0 / 3600))
        assert row["per_1000_km_low"] <= row["per_1000_km"] < row["per_1000_km_high"]


def test_unseen_mass_is_the_share_of_cells_that_were_seen_once(lake, catalogue):
    coverage = {row["definition"]: row for row in compute_figures(lake, catalogue)["coverage"].rows}
    assert coverage["cut_out"]["unseen_mass"] == 1.0 and coverage["cut_out"]["cells"] == 1
    assert sum(row["new_cells"] for row in compute_figures(lake, catalogue)["saturation"].rows) == sum(
        row["cells"] for row in coverage.values()
    )


def test_tables_have_every_cell_and_parameter(lake, catalogue):
    figures = compute_figures(lake, catalogue)
    assert len(figures["cells"].rows) == 10 and sum(row["cut_in"] for row in figures["cells"].rows) == 2
    known = {(row["definition"], row["parameter"]): row["known"] for row in figures["parameters"].rows}
    assert known["cut_in", "gap"] == 2 and ("cut_in", "rate") not in known
    assert {row["definition"] for row in figures["extremes"].rows} <= {"cut_in", "cut_out"}


def test_a_vehicle_that_vanishes_on_its_way_is_counted_as_left_out(tmp_path):
    (scenario,), truths = planted(["cut_in"], 5, Noise())
    crosses = round(truths[scenario.id]["at"] * 10)
    vanishes = replace(hidden(scenario, 1, slice(crosses + 2, None)), id=f"{scenario.id}a")
    blinks = replace(hidden(scenario, 1, slice(crosses - 2, crosses + 2)), id=f"{scenario.id}b")
    found = gather_catalogue(write_lake(tmp_path / "lake", [vanishes, blinks]))
    assert found.disturbances.num_rows == 0
    assert found.left_out == {
        "a vehicle on its way into the lane was not observed any more": 1,
        "a vehicle was not observed while it came into the lane or left it": 1,
    }


def test_two_hertz_are_named(tmp_path):
    lake = write_lake(tmp_path / "lake", [make_drive("slow", num_steps=9, dt=0.5, others=(Other(20.0, vx=10.0),))])
    assert gather_catalogue(lake).left_out == {
        "timesteps of 0.25 s and more: smoothing over half a second has no effect": 1
    }


def test_the_pack_is_computed_again_to_the_last_bit(lake, catalogue, tmp_path):
    out = write_catalogue(lake, catalogue, tmp_path / "pack")
    other = write_lake(tmp_path / "other", [*reversed(SCENARIOS), *planted(["cut_in"] * 5, 6, Noise())[0][4:]])
    assert compare_catalogue(other, out) == []
    tables = {path.name: path.stat().st_size for path in out.glob("*.parquet")}
    assert set(tables) == {"disturbances.parquet", "exposure.parquet"}
    with duckdb.connect() as connection:  # what the pack says can be run in it
        for name in ("disturbances", "exposure"):
            connection.execute(f"CREATE VIEW {name} AS FROM '{out}/{name}.parquet'")
        for name in FIGURES:
            assert connection.execute((out / "figures" / f"{name}.sql").read_text()).fetchall() is not None


def test_what_differs_is_said(lake, catalogue, tmp_path):
    wrong = catalogue.disturbances.set_column(
        catalogue.disturbances.column_names.index("gap"), "gap", catalogue.disturbances["speed"]
    )
    out = write_catalogue(lake, replace(catalogue, disturbances=wrong), tmp_path / "pack")
    assert compare_catalogue(lake, out) == ["disturbances: 3 rows before, 3 again, not all the same"]
    described = json.loads((out / FILE).read_text())
    (out / FILE).write_text(json.dumps(described | {"definitions_sha256": "0"}))
    assert compare_catalogue(lake, out)[0] == "the definitions are others in this version of the software"
    with pytest.raises(ScenarioNotFound, match="1 of 4 scenarios of the catalogue are not there"):
        compare_catalogue(write_lake(tmp_path / "less", SCENARIOS[1:]), out)
    shutil.rmtree(out / "definitions")
    (out / FILE).write_text("{}")
    with pytest.raises(BadParameter, match="no catalogue can be read"):
        compare_catalogue(lake, out)


def test_folders_that_exist_and_lakes_without_scenarios_are_refused(lake, catalogue, tmp_path):
    with pytest.raises(BadParameter, match="exists; choose another name"):
        write_catalogue(lake, catalogue, tmp_path)
    lake.filter("false", name="none", allow_empty=True, replace=True)
    with pytest.raises(EmptyResult, match="no recorded or generated scenarios"):
        gather_catalogue(lake, "none")


def test_every_definition_says_what_is_of_the_norm_and_what_is_ours():
    assert set(DISTURBANCES.names()) >= {kind for kind in KINDS if kind != "none"}
    for name, text in definition_texts().items():
        assert "Source: " in text and "our reading" in text, name
        assert "$" not in text.partition("\n")[2]
        assert {each for each in PARAMETERS if f" {each}" in text}
    for name in FIGURES:
        assert CATALOGUE.load(name).doc
