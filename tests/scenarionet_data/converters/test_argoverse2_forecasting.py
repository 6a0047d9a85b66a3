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
    assert scenario.tracks_to_predict == (("138902", 0), ("138909", 0))
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


BAD_ROWS: dict[str, tuple[Callable[[pa.Table], pa.Table], str]] = {
    "NaN": (lambda t: with_value(t, "position_x", 7, float("nan")), "position_x.*finite"),
    "infinite": (lambda t: with_value(t, "velocity_y", 7, float("inf")), "finite"),
    "null": (lambda t: with_value(t, "heading", 7, None), "heading: expected no nulls"),
    "null id": (lambda t: with_value(t, "track_id", 7, None), "track_id: expected no nulls"),
    "no ego": (without_ego, "ego_id: expected a track 'AV'"),
    "duplicate": (lambda t: pa.concat_tables([t, t.slice(3, 1)]), "found 2 of track 138902 at timestep 3"),
    "late": (lambda t: with_value(t, "timestep", 7, 110), r"expected timesteps 0 to 109, found 110"),
    "early": (lambda t: with_value(t, "timestep", 7, -1), r"expected timesteps 0 to 109, found -1"),
    "column": (lambda t: t.drop_columns(["heading"]), "expected a column heading"),
    "no rows": (lambda t: t.slice(0, 0), "expected rows, found none"),
    "words for numbers": (lambda t: t.set_column(8, "velocity_x", t["track_id"]), "expected finite numbers"),
}


@pytest.mark.parametrize("name", BAD_ROWS)
def test_bad_rows_are_refused(forecasting: Path, name: str) -> None:
    change, message = BAD_ROWS[name]
    change_rows(forecasting, change)
    with pytest.raises(InvalidScenario, match=message) as caught:
        scenarios(CONVERTER, forecasting.parent)
    assert caught.value.scenario_id == f"argoverse2/v2/{forecasting.name}"


def test_missing_focal_track_is_refused(forecasting: Path) -> None:
    change_rows(forecasting, lambda table: table.filter(pa.compute.field("track_id") != "138902"))
    with pytest.raises(InvalidScenario, match="objects_of_interest"):
        scenarios(CONVERTER, forecasting.parent)[0].validate()


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
    "no lanes": (lambda m: m | {"lane_segments": {}}, "no lanes"),
    "a list": (lambda m: [m], "map archive"),
    "no key": (lambda m: {k: m[k] for k in m if k != "drivable_areas"}, "drivable_areas"),
    "one point": (lambda m: _with_left_side(m, slice(0, 1)), "a line of 1 points"),
    "NaN": (lambda m: _with_left_side(m, slice(None), float("nan")), "not finite"),
}


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
