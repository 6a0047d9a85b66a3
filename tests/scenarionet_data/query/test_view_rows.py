"""Views of a lake agree with NumPy on its scenarios."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import (
    BadParameter,
    QueryError,
)
from scenarionet_data.query.named_sql import Folder
from scenarionet_data.query.views import FILE_TABLES
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType
from scenarionet_data.schema import tables
from scenarionet_data.storage.evaluation_runs import RUN_TABLES
from tests.fixtures import oracle
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import NUM_VARIED, make_scenario


def test_states_are_the_valid_steps(lake):
    """Row for row, the values of the arrays."""
    found = lake.sql("SELECT * FROM states ORDER BY scenario_id, track_id, timestep")
    rows = []
    for scenario in ScenarioLoader(lake):
        tracks = scenario.tracks
        for n, t in np.argwhere(tracks.valid):
            x, y, z = tracks.position[n, t]
            vx, vy = tracks.velocity[n, t]
            name, height = ObjectType(tracks.object_type[n]).name, z if scenario.has_z else None
            moving = (x, y, height, tracks.heading[n, t], vx, vy, np.hypot(vx, vy), *tracks.size[n, t])
            source_type = tracks.source_type[n]
            rows.append((scenario.id, tracks.ids[n], name, source_type, t, *moving, tracks.is_interpolated[n, t]))
    rows.sort(key=lambda row: (row[0], row[1], row[4]))
    assert found.columns == [
        *("scenario_id", "track_id", "object_type", "source_type", "timestep", "x", "y"),
        *("z", "heading", "vx", "vy", "speed", "length", "width", "height", "is_interpolated"),
    ]
    assert len(found) == len(rows)
    assert {row[-1] for row in rows} == {False, True}
    for index, name in enumerate(found.columns):
        wanted = [row[index] for row in rows]
        if name == "speed":
            assert found[name].to_list() == pytest.approx(wanted, rel=1e-6)
        else:
            assert found[name].to_list() == wanted, name


def test_objects_view_describes_whole_tracks(lake):
    found = {(row["scenario_id"], row["track_id"]): row for row in lake.sql("SELECT * FROM objects").to_dicts()}
    for scenario in ScenarioLoader(lake):
        tracks = scenario.tracks
        for n in range(len(tracks)):
            row = found.pop((scenario.id, tracks.ids[n]))
            steps = np.flatnonzero(tracks.valid[n])
            assert row["object_type"] == ObjectType(tracks.object_type[n]).name
            assert row["track_index"] == n
            assert row["num_states"] == len(steps)
            if not len(steps):
                assert row["mean_speed"] is row["length"] is None
                assert row["distance"] == 0
                continue
            assert (row["first_timestep"], row["last_timestep"]) == (steps[0], steps[-1])
            speed = np.hypot(*tracks.velocity[n, steps].T)
            assert row["distance"] == pytest.approx(oracle.length(oracle.path(scenario, n)), rel=1e-5, abs=1e-4)
            assert (row["mean_speed"], row["max_speed"]) == pytest.approx((speed.mean(), speed.max()), rel=1e-5)
            assert (row["length"], row["width"], row["height"]) == tuple(tracks.size[n, steps[0]])
    assert not found


def test_steps_view_pairs_successive_valid_timesteps(lake):
    found = lake.sql("SELECT * FROM steps ORDER BY scenario_id, track_id, timestep").to_dicts()
    wanted = []
    for scenario in ScenarioLoader(lake):
        tracks, last = scenario.tracks, scenario.num_timesteps - 1
        for n in sorted(range(len(tracks)), key=lambda n: tracks.ids[n]):
            valid, move = tracks.valid[n], np.diff(tracks.position[n], axis=0)
            for t in np.flatnonzero(valid[1:] & valid[:-1]):
                inner = bool(0 < t < last - 1 and valid[t - 1] and valid[t + 2])
                time = scenario.timestamps[t + 1] - scenario.timestamps[t]
                velocity = tracks.velocity[n, t : t + 2].mean(axis=0)
                wanted.append((scenario.id, tracks.ids[n], t + 1, time, *move[t, :2], *velocity, inner))
    assert len(found) == len(wanted)
    for row, (scenario_id, track_id, timestep, time, dx, dy, vx, vy, inner) in zip(found, wanted, strict=True):
        assert (row["scenario_id"], row["track_id"], row["timestep"]) == (scenario_id, track_id, timestep)
        numbers = (row["seconds"], row["dx"], row["dy"], row["vx"], row["vy"])
        assert numbers == pytest.approx((time, dx, dy, vx, vy), rel=1e-5, abs=1e-6)
        assert row["is_inner"] == inner


def test_metadata_matches_reference(lake):
    rows = {row["scenario_id"]: row for row in lake.sql("SELECT * FROM metadata").to_dicts()}
    for scenario in ScenarioLoader(lake):
        row = rows[scenario.id]
        for name, value in oracle.statistics(scenario).items():
            assert row[name] == (value if value is None else pytest.approx(value, rel=1e-5, abs=1e-4)), name
        assert row["timestamps"] == scenario.timestamps.tolist()
        assert row["duration"] == pytest.approx(scenario.timestamps[-1])


def test_light_and_map_views_match_the_arrays(lake):
    lights = lake.sql("SELECT scenario_id, light_id, lane_id, state, stop_x FROM lights ORDER BY ALL").rows()
    wanted = [
        (s.id, s.lights.ids[k], s.lights.lane_ids[k], [LightState(c).name for c in s.lights.state[k]],
         None if np.isnan(s.lights.stop_point[k, 0]) else s.lights.stop_point[k, 0])
        for s in ScenarioLoader(lake)
        for k in range(len(s.lights))
    ]  # fmt: skip
    assert lights == sorted(wanted, key=lambda row: row[:3])
    maps = lake.sql(
        "SELECT map_id, feature_id, feature_type, x, len(polygon_x) FROM maps ORDER BY map_id, feature_index"
    )
    wanted = [
        (
            s.id,
            s.map.ids[k],
            MapFeatureType(s.map.feature_type[k]).name,
            s.map.polyline[k][:, 0].tolist(),
            len(s.map.polygon[k]),
        )
        for s in ScenarioLoader(lake)
        for k in range(len(s.map or ()))
    ]
    assert maps.rows() == wanted


@pytest.mark.parametrize("name", Folder("views", QueryError).names())
def test_every_view_has_its_columns_in_an_empty_lake(lake, empty_lake, name):
    full, found = lake.sql(f"SELECT * FROM {name} LIMIT 0"), empty_lake.sql(f"SELECT * FROM {name}")
    assert found.schema == full.schema
    assert len(found) == len(full) == 0


def test_summary_of_an_empty_lake_is_empty(empty_lake):
    assert len(empty_lake) == 0
    assert empty_lake.summary().is_empty()


def test_lake_without_lights_and_maps(tmp_path):
    bare = write_lake(tmp_path, [make_scenario(1, num_lights=0, has_map=False)])
    assert bare.sql("SELECT count(*) FROM lights").item() == 0
    assert bare.sql("SELECT count(*) FROM maps").item() == 0
    assert bare.sql("SELECT count(*) FROM metadata LEFT JOIN lights USING (scenario_id)").item() == 1
    assert len(bare.filter(name="no", filters=["no_traffic_light"])) == 1


def test_columns_have_the_schema_descriptions(lake):
    lake.sql("SELECT 1 FROM metadata, tracks LIMIT 0")
    query = "SELECT comment FROM duckdb_columns() WHERE table_name = $table AND column_name = $column"
    for table, column in (("metadata", "ego_distance"), ("tracks", "vx"), ("metadata", "duration")):
        (comment,) = lake.sql(query, {"table": table, "column": column})["comment"]
        assert comment.startswith(tables.load(table).column(column).doc)


def test_files_view_lists_readable_paths(lake):
    for table in FILE_TABLES:
        paths = lake.paths(table)
        assert paths == sorted(paths)
        if table not in ("quarantine", "defects", "moments", *RUN_TABLES):
            assert (
                len(pl.read_parquet(paths, hive_partitioning=False)) == lake.sql(f"SELECT count(*) FROM {table}").item()
            )
    with pytest.raises(BadParameter, match=r"no table 'nothing'; there are metadata, tracks"):
        lake.paths("nothing")


def test_summary_counts_add_up(lake):
    (row,) = lake.summary().to_dicts()
    loaded = list(ScenarioLoader(lake))
    assert (row["dataset"], row["version"], row["split"], row["scenarios"]) == ("made", "v1", "train", NUM_VARIED)
    assert row["total_states"] == sum(s.tracks.valid.sum() for s in loaded)
    assert row["hours"] == pytest.approx(sum(s.num_timesteps * s.dt for s in loaded) / 3600, abs=5e-4)
