"""Argoverse 2 motion forecasting: content of a scenario, and refused input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.feather
import pyarrow.parquet
import pytest

from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.testing import differences
from tests.fixtures import argoverse2 as fixture
from tests.fixtures import argoverse2_world as world
from tests.fixtures.reading import scenarios, shards

CONVERTER = Argoverse2()


@pytest.fixture
def forecasting(tmp_path: Path) -> Path:
    (folder,) = fixture.write_forecasting(tmp_path / "raw", num_scenarios=1, num_tracks=20, num_timesteps=110)
    return folder


def test_forecasting_keeps_source_values(forecasting: Path) -> None:
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    tracks = scenario.tracks
    assert scenario.ego_id == "AV"
    assert (scenario.tracks_to_predict, scenario.objects_of_interest) == ((("138902", 0),), ("138909",))
    kinds = {word: ObjectType(code) for word, code in zip(tracks.source_type, tracks.object_type, strict=True)}
    assert kinds["bus"] is ObjectType.VEHICLE
    assert kinds["motorcyclist"] is ObjectType.CYCLIST
    assert kinds["construction"] is ObjectType.TRAFFIC_CONE
    assert kinds["riderless_bicycle"] is ObjectType.OTHER
    assert tracks.is_size_assumed.all()
    assert set(tracks.source_type[tracks.is_type_assumed]) == {"construction"}
    assert not tracks.is_velocity_estimated.any()
    assert json.loads(tracks.extras[0]) == {"object_category": "FOCAL"}
    assert scenario.source.licence == "CC BY-NC-SA 4.0"


def test_forecasting_objects_are_at_ground_height(forecasting: Path) -> None:
    """Heights interpolated from the map are compared with the height function of the generated road."""
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    position = scenario.tracks.position.astype(np.float64) + scenario.origin
    bottom = position[..., 2] - scenario.tracks.size[..., 2] / 2.0
    along = np.clip(position[..., 0], -505.0, -245.0)
    error = np.abs(bottom - world.road(along, 0.0)[..., 2])[scenario.tracks.valid]
    assert np.median(error) < 0.05
    assert error.max() < 0.3


def test_scenarios_of_different_lengths_share_a_shard(tmp_path: Path) -> None:
    fixture.write_forecasting(tmp_path, num_scenarios=1, seed=1, num_tracks=4, num_timesteps=110)
    fixture.write_forecasting(tmp_path, num_scenarios=1, seed=2, num_tracks=4, num_timesteps=50)
    assert len(shards(CONVERTER, tmp_path)) == 1
    assert sorted(s.num_timesteps for s in scenarios(CONVERTER, tmp_path)) == [50, 110]


def test_scenario_without_future_keeps_its_timesteps(forecasting: Path) -> None:
    """The test split has only the rows of the observed half."""
    change_rows(forecasting, lambda table: table.filter(pa.compute.field("timestep") < 50))
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    scenario.validate()
    assert scenario.num_timesteps == 110
    assert scenario.current_timestep == 49
    assert not scenario.tracks.valid[:, 50:].any()


def test_optional_columns_may_be_missing(forecasting: Path) -> None:
    change_rows(forecasting, lambda table: table.drop_columns(["map_id", "slice_id"]))
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    scenario.validate()
    assert scenario.source.log is None


def change_rows(folder: Path, change: Callable[[pa.Table], pa.Table]) -> None:
    (path,) = folder.glob("*.parquet")
    fixture.write_parquet(path, change(pa.parquet.read_table(path)))


def with_value(table: pa.Table, column: str, row: int, value: Any) -> pa.Table:
    values = table[column].to_pylist()
    values[row] = value
    index = table.column_names.index(column)
    return table.set_column(index, column, pa.array(values, table.schema.field(column).type))


def without_ego(table: pa.Table) -> pa.Table:
    return table.filter(pa.compute.field("track_id") != "AV")


BAD_ROWS: dict[str, tuple[Callable[[pa.Table], pa.Table], str, str]] = {
    "NaN": (lambda t: with_value(t, "position_x", 7, float("nan")), "position_x", "finite metres, found no number"),
    "infinite": (lambda t: with_value(t, "velocity_y", 7, float("inf")), "velocity_x", "up to 150 m/s"),
    "far": (lambda t: with_value(t, "position_y", 7, 1e12), "position_x", "within 10,000 m of the ego"),
    "null": (lambda t: with_value(t, "heading", 7, None), "heading", "finite radians, found no number"),
    "null id": (lambda t: with_value(t, "track_id", 7, None), "track_id", "the id of a track, found null"),
    "late": (lambda t: with_value(t, "timestep", 7, 110), "timestep", "a timestep of the scenario"),
    "early": (lambda t: with_value(t, "timestep", 7, -1), "timestep", "a timestep of the scenario"),
}


@pytest.mark.parametrize("name", BAD_ROWS)
def test_bad_row_is_dropped(forecasting: Path, name: str) -> None:
    change, field, reason = BAD_ROWS[name]
    (whole,) = scenarios(CONVERTER, forecasting.parent)
    change_rows(forecasting, change)
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    scenario.validate()
    (defect,) = scenario.defects
    assert (defect.table, defect.location, defect.field, defect.action) == ("tracks", "row 7", field, "dropped")
    assert reason in defect.reason
    assert defect.file == f"{forecasting.name}/scenario_{forecasting.name}.parquet"
    assert scenario.tracks.valid.sum() == whole.tracks.valid.sum() - 1


def test_repeated_row_is_dropped(forecasting: Path) -> None:
    (whole,) = scenarios(CONVERTER, forecasting.parent)
    change_rows(forecasting, lambda t: pa.concat_tables([t, t.slice(3, 1)]))
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    assert scenario.defects[0].reason == "expected one row for an object and time, found another"
    assert differences(whole, scenario) == []


BAD_TABLES: dict[str, tuple[Callable[[pa.Table], pa.Table], str]] = {
    "no ego": (without_ego, "usable rows of the track 'AV'"),
    "column": (lambda t: t.drop_columns(["heading"]), "expected one column heading"),
    "no rows": (lambda t: t.slice(0, 0), "expected text, found only nulls"),
    "words for numbers": (
        lambda t: t.set_column(t.column_names.index("velocity_x"), "velocity_x", t["track_id"]),
        "column velocity_x: expected numbers, found",
    ),
    "objects for words": (
        lambda t: t.set_column(t.column_names.index("object_type"), "object_type", pa.array([{"a": 1}] * len(t))),
        "column object_type: expected text, found struct",
    ),
}


@pytest.mark.parametrize("name", BAD_TABLES)
def test_bad_tables_are_refused(forecasting: Path, name: str) -> None:
    change, message = BAD_TABLES[name]
    change_rows(forecasting, change)
    with pytest.raises(InvalidScenario, match=message) as caught:
        scenarios(CONVERTER, forecasting.parent)
    assert caught.value.scenario_id == f"argoverse2/v2/{forecasting.name}"


def test_scored_tracks_are_of_interest_and_the_focal_one_is_to_be_predicted(forecasting: Path) -> None:
    """As in ScenarioNet's converter."""
    (path,) = forecasting.glob("*.parquet")
    rows = pa.parquet.read_table(path).to_pylist()
    scored = dict.fromkeys(row["track_id"] for row in rows if row["object_category"] == 2)
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    assert set(scenario.objects_of_interest) == set(scored)
    assert scored
    assert scenario.tracks_to_predict == ((rows[0]["focal_track_id"], 0),)


def test_missing_focal_track_is_reported(forecasting: Path) -> None:
    change_rows(forecasting, lambda table: table.filter(pa.compute.field("track_id") != "138902"))
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    scenario.validate()
    assert scenario.tracks_to_predict == ()
    assert [(d.action, d.location, d.field) for d in scenario.defects] == [
        ("assumed", "track 138902", "focal_track_id")
    ]


def test_ego_missing_at_current_timestep_is_refused(forecasting: Path) -> None:
    is_kept = (pa.compute.field("track_id") != "AV") | (pa.compute.field("timestep") < 30)
    change_rows(forecasting, lambda table: table.filter(is_kept))
    with pytest.raises(InvalidScenario, match="ego valid at current_timestep 49"):
        scenarios(CONVERTER, forecasting.parent)[0].validate()


def test_copied_file_is_refused(forecasting: Path) -> None:
    (path,) = forecasting.glob("*.parquet")
    path.rename(path.with_name("scenario_other.parquet"))
    with pytest.raises(InvalidScenario, match="restore its original name"):
        scenarios(CONVERTER, forecasting.parent)


BAD_MAPS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no lanes": (lambda m: m | {"lane_segments": {}}, "found no usable one"),
    "a list": (lambda m: [m], "map archive"),
    "no key": (lambda m: {k: m[k] for k in m if k != "drivable_areas"}, "drivable_areas"),
}
BAD_LANES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "one point": (lambda m: _with_left_side(m, slice(0, 1)), "at least 2 points, found 1"),
    "NaN": (lambda m: _with_left_side(m, slice(None), float("nan")), "points of finite x, y and z"),
    "far": (lambda m: _with_left_side(m, slice(None), 1e12), "within 200,000 m"),
    "an object": (lambda m: _with(m, "lane_type", {}), "lane_type to be str, found dict"),
    "no id": (lambda m: _with(m, "id", None), "id to be int or str, found NoneType"),
    "odd links": (lambda m: _with(m, "successors", [[]]), "ids of lanes as predecessors"),
    "no centreline": (lambda m: _with(m, "centerline", None, is_kept=False), "expected a centerline"),
}


def _with(archive: dict[str, Any], field: str, value: Any, *, is_kept: bool = True) -> dict[str, Any]:
    lane = next(iter(archive["lane_segments"].values()))
    if is_kept:
        lane[field] = value
    else:
        del lane[field]
    return archive


@pytest.mark.parametrize("name", BAD_LANES)
def test_bad_lane_is_left_out(forecasting: Path, name: str) -> None:
    change, reason = BAD_LANES[name]
    (path,) = forecasting.glob("*.json")
    archive = json.loads(path.read_text())
    lost = next(iter(archive["lane_segments"]))
    (whole,) = scenarios(CONVERTER, forecasting.parent)
    path.write_text(json.dumps(change(archive)))
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    scenario.validate()
    (defect,) = scenario.defects
    assert (defect.table, defect.location) == ("maps", f"lane_segments {lost}")
    assert reason in defect.reason
    assert len(whole.map) - 3 <= len(scenario.map) < len(whole.map)


def _with_left_side(archive: dict[str, Any], part: slice, z: float = 0.0) -> dict[str, Any]:
    lane = next(iter(archive["lane_segments"].values()))
    lane["left_lane_boundary"] = [point | {"z": z} for point in lane["left_lane_boundary"]][part]
    return archive


@pytest.mark.parametrize("name", BAD_MAPS)
def test_bad_maps_are_refused(forecasting: Path, name: str) -> None:
    change, message = BAD_MAPS[name]
    (path,) = forecasting.glob("*.json")
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(InvalidScenario, match=message):
        scenarios(CONVERTER, forecasting.parent)


def test_bad_folder_does_not_affect_the_others(tmp_path: Path) -> None:
    folders = fixture.write_forecasting(tmp_path, num_scenarios=3, num_tracks=4)
    next(folders[1].glob("*.json")).unlink()
    (shard,) = shards(CONVERTER, tmp_path)
    outcomes = []
    for record in CONVERTER.records(shard):
        try:
            outcomes.append(CONVERTER.scenario(shard, record).source.scenario_id)
        except InvalidScenario as error:
            assert "no such map; download the folder it belongs to again" in str(error)
            outcomes.append("refused")
    assert sorted(outcomes) == sorted([folders[0].name, "refused", folders[2].name])
