"""Questions to a lake: views against NumPy on loaded scenarios, filters, splits, databases and their lineage."""

from __future__ import annotations

import datetime
import hashlib
import re
import shutil
import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow as pa
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert, tables
from scenarionet_data.catalog import database as databases
from scenarionet_data.catalog import filters, named_sql
from scenarionet_data.catalog.engine import FILE_TABLES
from scenarionet_data.catalog.operations.pool import StaleDatabaseWarning
from scenarionet_data.errors import (
    BadParameter,
    DatabaseExists,
    DatabaseNotFound,
    EmptyResult,
    LakeError,
    NoSuchSnapshot,
    QueryError,
    ScenarioNotFound,
    UnknownFilter,
    UnsafeSql,
)
from scenarionet_data.resources import SQL
from scenarionet_data.store.runs import RUN_TABLES
from scenarionet_data.vocabulary import LightState, MapFeatureType, ObjectType
from tests.fixtures import oracle
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario, renamed

COUNT = 12


def scenarios():
    """With and without heights, lights, map, gaps, timestamps of their own."""
    return [
        make_scenario(k, num_objects=4 + k % 3, num_lights=k % 3, has_z=k % 4 > 0, has_map=k % 5 > 0)
        for k in range(COUNT)
    ]


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """For reading only: tests that save databases make a lake of their own."""
    return write_lake(tmp_path_factory.mktemp("catalog"), scenarios())


@pytest.fixture
def own(tmp_path):
    """A lake to save databases in."""
    made = [make_scenario(k, num_objects=2 + k % 4, num_steps=6, num_lanes=1) for k in range(COUNT)]
    return write_lake(tmp_path / "lake", made)


# --- views --------------------------------------------------------------------------------------------


def test_states_are_the_valid_steps(lake):
    """Row for row what the arrays hold."""
    found = lake.sql("SELECT * FROM states ORDER BY scenario_id, track_id, timestep")
    rows = []
    for scenario in ScenarioLoader(lake):
        tracks = scenario.tracks
        for n, t in np.argwhere(tracks.valid):
            x, y, z = tracks.position[n, t]
            vx, vy = tracks.velocity[n, t]
            name, height = ObjectType(tracks.object_type[n]).name, z if scenario.has_z else None
            moving = (x, y, height, tracks.heading[n, t], vx, vy, np.hypot(vx, vy), *tracks.size[n, t])
            rows.append((scenario.id, tracks.ids[n], name, t, *moving))
    rows.sort(key=lambda row: (row[0], row[1], row[3]))
    assert found.columns == [
        *("scenario_id", "track_id", "object_type", "timestep", "x", "y"),
        *("z", "heading", "vx", "vy", "speed", "length", "width", "height"),
    ]
    assert len(found) == len(rows)
    for index, name in enumerate(found.columns):
        wanted = [row[index] for row in rows]
        if name == "speed":
            assert found[name].to_list() == pytest.approx(wanted, rel=1e-6)
        else:
            assert found[name].to_list() == wanted, name


def test_objects_are_facts_of_whole_tracks(lake):
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


def test_steps_are_pairs_of_successive_valid_timesteps(lake):
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


def test_metadata_is_the_oracles(lake):
    rows = {row["scenario_id"]: row for row in lake.sql("SELECT * FROM metadata").to_dicts()}
    for scenario in ScenarioLoader(lake):
        row = rows[scenario.id]
        for name, value in oracle.statistics(scenario).items():
            assert row[name] == (value if value is None else pytest.approx(value, rel=1e-5, abs=1e-4)), name
        assert row["timestamps"] == scenario.timestamps.tolist()
        assert row["duration"] == pytest.approx((scenario.num_timesteps - 1) * 0.1)


def test_lights_and_maps_are_the_arrays(lake):
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
            MapFeatureType(s.map.types[k]).name,
            s.map.polyline[k][:, 0].tolist(),
            len(s.map.polygon[k]),
        )
        for s in ScenarioLoader(lake)
        for k in range(len(s.map or ()))
    ]
    assert maps.rows() == wanted


@pytest.mark.parametrize("name", named_sql.names("views"))
def test_every_view_has_its_columns_in_an_empty_lake(lake, tmp_path, name):
    (tmp_path / "snapshots").mkdir()
    empty, full = Lake(tmp_path), lake.sql(f"SELECT * FROM {name} LIMIT 0")
    found = empty.sql(f"SELECT * FROM {name}")
    assert found.schema == full.schema
    assert len(found) == len(full) == 0
    assert len(empty) == 0
    assert empty.summary().is_empty()


def test_a_lake_without_lights_and_maps(tmp_path):
    bare = write_lake(tmp_path, [make_scenario(1, num_lights=0, has_map=False)])
    assert bare.sql("SELECT count(*) FROM lights").item() == 0
    assert bare.sql("SELECT count(*) FROM maps").item() == 0
    assert bare.sql("SELECT count(*) FROM metadata LEFT JOIN lights USING (scenario_id)").item() == 1
    assert len(bare.filter(name="no", named=["no_traffic_light"])) == 1


def test_views_carry_the_contracts_words(lake):
    lake.sql("SELECT 1 FROM metadata, tracks LIMIT 0")
    query = "SELECT comment FROM duckdb_columns() WHERE table_name = $table AND column_name = $column"
    for table, column in (("metadata", "ego_distance"), ("tracks", "vx"), ("metadata", "duration")):
        (comment,) = lake.sql(query, {"table": table, "column": column})["comment"]
        assert comment.startswith(tables.load(table).column(column).doc)


def test_paths_are_what_any_engine_may_read(lake):
    for table in FILE_TABLES:
        paths = lake.paths(table)
        assert paths == sorted(paths)
        if table not in ("quarantine", *RUN_TABLES):
            assert (
                len(pl.read_parquet(paths, hive_partitioning=False)) == lake.sql(f"SELECT count(*) FROM {table}").item()
            )
    with pytest.raises(BadParameter, match=r"no table 'nothing'; there are metadata, tracks"):
        lake.paths("nothing")


def test_summary_adds_up(lake):
    (row,) = lake.summary().to_dicts()
    loaded = list(ScenarioLoader(lake))
    assert (row["dataset"], row["version"], row["split"], row["scenarios"]) == ("made", "v1", "train", COUNT)
    assert row["states"] == sum(s.tracks.valid.sum() for s in loaded)
    assert row["hours"] == pytest.approx(sum(s.num_timesteps * s.dt for s in loaded) / 3600, abs=5e-4)


# --- only reading ---------------------------------------------------------------------------------------


def unsafe(root):
    """Statements that change something, here or elsewhere, or read what is not the lake's."""
    return [
        "INSERT INTO metadata VALUES (1)",
        "UPDATE metadata SET city = 'x'",
        "DELETE FROM metadata",
        "MERGE INTO metadata USING metadata ON true WHEN MATCHED THEN DELETE",
        "CREATE TABLE t AS SELECT 1",
        "CREATE VIEW v AS SELECT 1",
        "CREATE MACRO f(a) AS a + 1",
        "CREATE SECRET s (TYPE s3)",
        "DROP VIEW metadata",
        "ALTER VIEW metadata RENAME TO x",
        "COMMENT ON VIEW metadata IS 'x'",
        f"ATTACH '{root}/x.db'",
        "DETACH memory",
        "USE memory",
        f"COPY (SELECT 1) TO '{root}/x'",
        f"COPY metadata TO '{root}/x.parquet'",
        f"WITH t AS (COPY (SELECT 1) TO '{root}/x') SELECT * FROM t",
        f"(WITH t AS (COPY (SELECT 1) TO '{root}/x') SELECT * FROM t)",
        f"WITH t AS MATERIALIZED (COPY (SELECT 1) TO '{root}/x') SELECT 1 UNION ALL SELECT 2",
        "WITH t AS (INSERT INTO metadata VALUES (1) RETURNING *) SELECT * FROM t",
        f"EXPORT DATABASE '{root}/x'",
        f"IMPORT DATABASE '{root}/x'",
        "SET threads = 1",
        "RESET threads",
        "SET VARIABLE tracks_files = ['x']",
        "INSTALL httpfs",
        "LOAD httpfs",
        "CALL pragma_version()",
        "EXPLAIN SELECT 1",
        "CHECKPOINT",
        "VACUUM",
        "BEGIN",
        "PREPARE p AS SELECT 1",
        "EXECUTE p",
        "SELECT 1; SELECT 2",
        "SELECT 1; DROP VIEW metadata",
        "SELECT 1) AS x; DROP VIEW metadata; SELECT * FROM (SELECT 1",
        "",
        ";",
        "-- nothing",
        "SELECT * FROM read_text('/etc/passwd')",
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM '/etc/passwd.csv'",
        f"SELECT * FROM read_text('{root}/../secret.csv')",
        f"SELECT * FROM read_text('{root}2/secret.csv')",
        "SELECT * FROM 'secret.csv'",
        "SELECT * FROM glob('/etc/*')",
        "SELECT * FROM sniff_csv('/etc/passwd')",
        "SELECT * FROM parquet_metadata('/etc/passwd')",
        "SELECT * FROM 'https://example.com/x.parquet'",
        "SELECT * FROM query('DROP VIEW metadata')",
        "SELECT * FROM frame",
        "SELECT (SELECT count(*) FROM read_text('/etc/passwd'))",
        "SELECT nonsense FROM metadata",
        "SELECT * FROM nothing",
        "SELEKT 1",
        "SELECT $missing",
    ]


def files_below(folder):
    return sorted(str(path) for path in folder.rglob("*"))


def test_a_query_only_reads_the_lake(tmp_path, monkeypatch):
    root = tmp_path / "lake"
    lake = write_lake(root, [make_scenario(1, num_objects=2)])
    (tmp_path / "secret.csv").write_text("a\n1\n")
    (tmp_path / "lake2").mkdir()
    (tmp_path / "lake2" / "secret.csv").write_text("a\n1\n")
    monkeypatch.chdir(tmp_path)
    frame = pl.DataFrame({"a": [1]})  # a variable that DuckDB would find by its name
    before = files_below(tmp_path)
    for query in unsafe(root):
        try:
            lake.sql(query)
        except (QueryError, LakeError) as error:  # DuckDB 1 looks for the files of IMPORT while it parses
            assert str(error), query
        else:
            pytest.fail(f"was not refused: {query}")
    assert files_below(tmp_path) == before
    assert len(lake) == 1
    assert len(frame) == 1


@pytest.mark.parametrize(
    "query",
    [
        "SELECT 1 AS a;",
        "SELECT 1 AS a -- a comment; with a semicolon",
        "/* what */ SELECT 1 AS a",
        "FROM (VALUES (1)) AS t(a)",
        "WITH t AS (SELECT 1 AS a) SELECT * FROM t",
        "SELECT 1 AS a UNION SELECT 1",
        "SELECT $a::INTEGER AS a",
        "VALUES (1)",
        "SELECT ';' AS a",
    ],
)
def test_a_reading_statement_may_have_any_form(lake, query):
    assert len(lake.sql(query, {"a": 1} if "$a" in query else None)) == 1


def test_descriptions_are_reading_too(lake):
    assert "ego_distance" in lake.sql("DESCRIBE metadata")["column_name"].to_list()
    assert len(lake.sql("SUMMARIZE metadata")) > 50


def test_order_and_limit_are_the_queries(lake):
    ids = sorted(scenario.id for scenario in scenarios())
    query = "SELECT scenario_id FROM metadata ORDER BY scenario_id DESC LIMIT 3 OFFSET 1"
    assert lake.sql(query)["scenario_id"].to_list() == ids[::-1][1:4]


def test_threads_may_ask_at_once(tmp_path):
    """A server asks from many threads; answers must not be mixed up."""
    lake = write_lake(tmp_path, [make_scenario(k, num_objects=2, num_steps=4) for k in range(8)])
    ids = lake.sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"].to_list()
    lake = lake.refresh()

    def ask(k):
        states = lake.sql("SELECT $k AS k, count(*) AS n FROM states WHERE timestep = $t", {"k": k, "t": k % 4})
        return states["k"][0], lake.locate(ids[k % 8 :])["scenario_id"].to_pylist()

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(ask, range(40))) == [(k, ids[k % 8 :]) for k in range(40)]


def test_large_queries_spill_apart_from_each_other_and_from_the_working_directory(lake):
    query = "SELECT current_setting('temp_directory') AS folder"
    folders = [Path(opened.sql(query).item()) for opened in (lake, lake.refresh())]
    assert folders[0] != folders[1]
    assert {folder.parent for folder in folders} == {Path(tempfile.gettempdir())}


def test_tables_of_one_query_are_unknown_to_the_next(own):
    own.filter("true", name="all")
    own.filter("true", name="again", parent="all")
    for table in ("members", "wanted"):
        with pytest.raises(QueryError, match=f"{table} does not exist"):
            own.sql(f"SELECT * FROM {table}")


def test_odd_results_are_query_errors(lake):
    with pytest.raises(QueryError, match="cast odd types to VARCHAR"):
        lake.sql("SELECT INTERVAL 1 MONTH AS i")


# --- filters --------------------------------------------------------------------------------------------


def test_a_filter_keeps_what_satisfies_it_in_order_of_id(own):
    found = own.filter("num_objects > 3 AND ego_distance > $far", name="busy", parameters={"far": 1.0})
    wanted = own.sql("SELECT scenario_id FROM metadata WHERE num_objects > 3 AND ego_distance > 1.0 ORDER BY 1")
    assert 0 < len(found) < COUNT
    assert found.scenario_ids == wanted["scenario_id"].to_list()
    assert found.members["position"].to_pylist() == list(range(len(found)))
    assert found.members["weight"].to_pylist() == [1.0] * len(found)
    assert own.database("busy").members.equals(found.members)


def test_lineage_says_how_a_database_was_made(own):
    own.filter("num_objects > 2", name="some")
    made = own.filter("ego_distance > $far", name="few", parent="some", parameters={"far": 0.5})
    lineage = own.database("few").lineage
    assert lineage == made.lineage
    assert (lineage.operation, lineage.parents, lineage.snapshot) == ("filter", ["some@1"], 1)
    assert lineage.parameters == {"far": 0.5}
    assert "ego_distance > $far" in lineage.sql
    assert lineage.count == len(made)
    assert lineage.created_with
    assert own.lineage("few") == ("few@1", lineage)


def test_lineage_takes_parameters_that_can_be_run_again(own):
    made = own.filter("date IS NULL OR date::DATE > $day::DATE", name="recent", parameters={"day": "2024-05-17"})
    assert own.database("recent").lineage.parameters == {"day": "2024-05-17"} == made.lineage.parameters
    with pytest.raises(BadParameter, match=r"pass a date as text and compare with \$name::DATE"):
        own.filter("date::DATE > $day", name="never", parameters={"day": datetime.date(2024, 5, 17)})


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_a_filter_of_a_database_keeps_its_order_and_weights(own):
    ids = [scenario.id for scenario in scenarios()][::-1]
    hashes = {row["scenario_id"]: row["content_hash"] for row in own.sql("SELECT * FROM metadata").to_dicts()}
    members = pa.table(
        {
            "scenario_id": ids,
            "weight": np.arange(COUNT, dtype=np.float64),
            "content_hash": pa.array([hashes[i] for i in ids], pa.uint64()),
        }
    )
    lineage = replace(own.filter("true", name="any").lineage, operation="by hand")
    databases.save(own.files, "backwards", members, lineage, replace=False)
    kept = own.filter("num_objects > 2", name="kept", parent="backwards")
    large = set(own.filter("num_objects > 2", name="all").scenario_ids)
    wanted = [i for i in ids if i in large]
    assert kept.scenario_ids == wanted
    weights = dict(zip(ids, range(COUNT), strict=True))
    assert kept.members["weight"].to_pylist() == [weights[i] for i in wanted]
    parts = own.split("backwards", {"a": 0.5, "b": 0.5})
    for part in parts.values():
        assert part.scenario_ids == [i for i in ids if i in set(part.scenario_ids)]
        assert part.members["weight"].to_pylist() == [weights[i] for i in part.scenario_ids]


@pytest.mark.parametrize(
    "where",
    [
        "",
        " ",
        "a, b",
        "true, true",
        "true; DROP VIEW metadata",
        "1) OR (1",
        "true) UNION SELECT 1, 2, 3 --",
        "true)--",
        "true /* open",
        "SELECT 1",
        "true ORDER BY 1",
        "true LIMIT 0",
        "true GROUP BY 1",
        "true FROM metadata",
        "true WHERE false",
        "true UNION ALL SELECT 1",
        "DISTINCT true",
        "true AS x",
        "*",
        "count(*) > 1",
        "nonsense > 1",
        "$missing > 1",
        "(SELECT count(*) FROM read_text('/etc/passwd')) > 0",
        "EXISTS (WITH t AS (COPY (SELECT 1) TO 'x') SELECT * FROM t)",
    ],
)
def test_a_condition_is_one_expression_over_the_lake(lake, where):
    with pytest.raises(QueryError):
        lake.filter(where, name="never")
    assert "never" not in lake.databases


def test_more_than_one_expression_is_unsafe(lake):
    for where in ("true; DROP VIEW metadata", "a, b", "true) UNION SELECT 1, 2, 3 --"):
        with pytest.raises(UnsafeSql, match="wanted one condition such as ego_distance > 10"):
            lake.filter(where, name="never")


@pytest.mark.parametrize(
    "where",
    [
        "true -- with a comment",
        "(num_objects > 2)",
        "scenario_id IN (SELECT scenario_id FROM lights)",
        "EXISTS (SELECT 1 FROM tracks AS t WHERE t.scenario_id = metadata.scenario_id AND object_type = 'VEHICLE')",
        "CASE WHEN has_z THEN num_lights > 0 ELSE true END",
        "extras IS NULL OR json_extract(extras, '$.weather') IS NOT NULL",
    ],
)
def test_a_condition_may_ask_other_tables(own, where):
    assert 0 < len(own.filter(where, name="some")) <= COUNT


def test_named_filters_add_conditions(own):
    found = own.filter(
        "num_lights >= $n", name="x", named=["ego_distance:min=1", "object_count:min=3"], parameters={"n": 1}
    )
    wanted = own.filter("num_lights >= 1 AND ego_distance >= 1 AND num_objects >= 3", name="y")
    assert 0 < len(found) < COUNT
    assert found.scenario_ids == wanted.scenario_ids
    assert found.lineage.parameters["f0_min"] == 1.0


@pytest.mark.parametrize("name", filters.names())
def test_every_named_filter_runs_and_says_what_it_keeps(lake, name, tmp_path):
    found, values = filters.parse(name)
    assert found.doc.endswith(".")
    assert values == found.defaults
    assert not re.findall(r"\$(?!" + "|".join([*values, "$"]) + r")\w+", found.text)
    own = write_lake(tmp_path, [make_scenario(k, num_lights=k) for k in range(2)])
    assert 0 <= len(own.filter(name="kept", named=[name], allow_empty=True)) <= 2


def test_unknown_filters_and_parameters_are_named(lake):
    with pytest.raises(UnknownFilter, match="ego_distance"):
        lake.filter(name="x", named=["ego_distanse"])
    with pytest.raises(BadParameter, match="has no parameter 'least'; it has min, max"):
        lake.filter(name="x", named=["ego_distance:least=3"])
    with pytest.raises(BadParameter, match="min wants float, found 'three'"):
        lake.filter(name="x", named=["ego_distance:min=three"])


def test_filters_mean_what_they_say(tmp_path):
    flat = make_scenario(1, has_z=False)
    hilly = make_scenario(2)
    dark = make_scenario(3, num_lights=0)
    own = write_lake(tmp_path, [flat, hilly, dark])
    statistics = {s.id: oracle.statistics(s) for s in (flat, hilly, dark)}

    def kept(name):
        return set(own.filter(name="kept", named=[name], replace=True).scenario_ids)

    assert kept("no_overpass:max=1") == {
        i for i, row in statistics.items() if row["map_height_diff"] is None or row["map_height_diff"] < 1
    }
    assert flat.id in kept("no_overpass:max=1") != set(statistics)
    assert kept("has_traffic_light") == {flat.id, hilly.id}
    assert kept("no_traffic_light") == {dark.id}
    assert kept("has_construction") == {i for i, row in statistics.items() if row["has_construction"]}
    least = statistics[hilly.id]["num_objects"]
    assert kept(f"object_count:min={least},max={least}") == {
        i for i, row in statistics.items() if row["num_objects"] == least
    }


# --- databases ------------------------------------------------------------------------------------------


def test_databases_have_versions_and_are_not_overwritten_by_accident(own):
    first = own.filter("num_objects > 3", name="busy")
    with pytest.raises(DatabaseExists, match="--replace"):
        own.filter("num_objects > 4", name="busy")
    second = own.filter("num_objects > 4", name="busy", replace=True)
    assert (first.reference, second.reference) == ("busy@1", "busy@2")
    assert own.databases == ["busy"]
    assert own.database("busy").scenario_ids == second.scenario_ids != first.scenario_ids
    assert own.database("busy@1").scenario_ids == first.scenario_ids
    assert len(ScenarioLoader(own, "busy@1")) == len(first)


@pytest.mark.parametrize("name", ["", "a b", "../x", "a/b", ".x", "-x", "ü", "a@1"])
def test_names_are_plain_words(own, name):
    with pytest.raises(BadParameter, match="is no database name"):
        own.filter("true", name=name)


def test_databases_that_are_not_there_are_named_with_those_that_are(own):
    with pytest.raises(DatabaseNotFound, match="no database 'x'; databases: none yet"):
        own.database("x")
    own.filter("true", name="all")
    with pytest.raises(DatabaseNotFound, match="no database 'x'; databases: all"):
        own.filter("true", name="y", parent="x")
    with pytest.raises(DatabaseNotFound, match=r"no database 'all@7'; versions \[1\]"):
        own.database("all@7")
    with pytest.raises(BadParameter, match="wanted name or name@version, with a number"):
        own.database("all@new")


def test_an_empty_database_is_one_when_it_is_asked_for(own):
    with pytest.raises(EmptyResult, match=rf"none: no scenario is left of {COUNT}; loosen the conditions, or --al"):
        own.filter("false", name="none")
    assert own.databases == []
    none = own.filter("false", name="none", allow_empty=True)
    assert len(none) == 0
    assert len(own.filter("true", name="still", parent="none", allow_empty=True)) == 0
    assert len(ScenarioLoader(own, "none")) == 0
    with pytest.raises(EmptyResult, match="no scenario of 0 falls into a, b; other fractions, another seed, or --al"):
        own.split("none", {"a": 0.5, "b": 0.5})
    parts = own.split("none", {"a": 0.5, "b": 0.5}, allow_empty=True)
    assert [len(part) for part in parts.values()] == [0, 0]


def test_scenarios_are_located_in_the_order_asked_for(own):
    ids = own.sql("SELECT scenario_id FROM metadata ORDER BY 1 DESC")["scenario_id"].to_list()
    assert own.locate([*ids, ids[0]])["scenario_id"].to_pylist() == [*ids, ids[0]]
    with pytest.raises(ScenarioNotFound, match="no scenario made/v1/x in snapshot 1; 1 of 2 are missing"):
        own.locate([ids[0], "made/v1/x"])


# --- stale databases ------------------------------------------------------------------------------------


@pytest.fixture
def changed(tmp_path):
    """A lake whose scenarios 1 and 2 were replaced after database ``old`` was made, and the database of 3 was."""
    raw = write_raw(tmp_path / "raw", {"a": [1, 2], "b": [3]})
    root = tmp_path / "lake"
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=2))
    Lake(root).filter("true", name="old")
    Lake(root).filter("ends_with(scenario_id, '3')", name="same")
    (raw / "a.made").write_text("1\n4")
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=2), replace_old=True)
    return Lake(root)


def test_a_stale_database_is_read_from_its_own_snapshot_with_a_warning(changed):
    assert changed.snapshot.number > 1
    with pytest.warns(StaleDatabaseWarning, match=r"1 of 3 members of old@1 changed after snapshot 1"):
        loader = ScenarioLoader(changed, "old")
    assert [scenario.id[-1] for scenario in loader] == ["1", "2", "3"]


def test_what_is_made_from_a_stale_database_can_be_read(changed):
    with pytest.warns(StaleDatabaseWarning):
        child = changed.filter("true", name="child", parent="old")
    with pytest.warns(StaleDatabaseWarning):
        parts = changed.split("old", {"a": 0.5, "b": 0.5}, allow_empty=True)
    assert child.lineage.snapshot == 1
    assert {part.lineage.snapshot for part in parts.values()} == {1}
    with pytest.warns(StaleDatabaseWarning):
        assert len(list(ScenarioLoader(changed, "child"))) == 3


def test_a_database_of_unchanged_members_moves_with_the_lake(changed):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [scenario.id[-1] for scenario in ScenarioLoader(changed, "same")] == ["3"]


def test_a_database_whose_snapshot_is_gone_names_what_is_missing(changed):
    changed.files.path("snapshots/00000001.json").unlink()
    remedy = "old@1 was made on snapshot 1, which is gone, and members of it have changed since; `scenarionet rebase"
    with pytest.raises(NoSuchSnapshot, match=remedy):
        ScenarioLoader(changed, "old")


# --- splits ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log_lake(tmp_path_factory):
    """200 scenarios of 50 logs, four each; the last 10 have none."""
    template = make_scenario(1, num_objects=1, num_steps=2, num_lanes=0, num_lights=0, has_map=False)
    made = [renamed(template, f"s{k:03d}") for k in range(200)]
    logs = [f"log{k // 4}" if k < 190 else None for k in range(200)]
    return write_lake(
        tmp_path_factory.mktemp("logs"),
        [replace(s, source=replace(s.source, log=log)) for s, log in zip(made, logs, strict=True)],
    )


@pytest.fixture
def many(log_lake, tmp_path):
    """A copy to save databases in."""
    shutil.copytree(log_lake.root, tmp_path / "lake")
    return Lake(tmp_path / "lake")


def fraction(seed, group):
    """The split's number by hand."""
    return int(hashlib.md5(f"{seed}:{group}".encode()).hexdigest()[:13], 16) / 2**52


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_a_split_is_disjoint_exhaustive_and_by_md5(many):
    parts = many.split(None, {"train": 0.7, "val": 0.2, "test": 0.1}, seed=3)
    everything = [scenario_id for part in parts.values() for scenario_id in part.scenario_ids]
    assert sorted(everything) == [f"made/v1/s{k:03d}" for k in range(200)]
    assert many.databases == ["all_test", "all_train", "all_val"]
    for name, low, high in (("train", 0.0, 0.7), ("val", 0.7, 0.9), ("test", 0.9, 1.0)):
        assert all(low <= fraction(3, scenario_id) < high for scenario_id in parts[name].scenario_ids)
        assert parts[name].scenario_ids == sorted(parts[name].scenario_ids)
        assert parts[name].lineage.operation == "split"
        assert parts[name].lineage.parameters["seed"] == 3
    assert 120 < len(parts["train"]) < 160


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_a_split_never_changes(many):
    """Frozen: on another machine, with another DuckDB, in ten years."""
    parts = many.split(None, {"train": 0.9, "val": 0.1}, seed=0)
    val = "002 018 037 039 040 045 047 055 064 066 084 091 094 114 117 119 146 151 161 185 186 188 194"
    assert [i[-3:] for i in parts["val"].scenario_ids] == val.split()


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_a_scenario_keeps_its_part_as_the_lake_grows(many):
    before = many.split(None, {"a": 0.5, "b": 0.5}, prefix="x")
    template = make_scenario(1, num_objects=1, num_steps=2, num_lanes=0, num_lights=0, has_map=False)
    grown = write_lake(many.root, [renamed(template, f"new{k}") for k in range(50)], name="more")
    after = grown.split(None, {"a": 0.5, "b": 0.5}, prefix="x", replace=True)
    for part in "ab":
        assert set(before[part].scenario_ids) < set(after[part].scenario_ids)


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_another_seed_is_another_split(many):
    zero, one = (many.split(None, {"a": 0.5, "b": 0.5}, seed=s, prefix=f"s{s}")["a"].scenario_ids for s in (0, 1))
    assert zero != one


def test_scenarios_of_one_log_stay_together(many):
    parts = many.split(None, {"a": 0.5, "b": 0.5}, by="source_log")
    logs = {row["scenario_id"]: row["source_log"] for row in many.sql("SELECT * FROM metadata").to_dicts()}
    sides = [{logs[i] for i in part.scenario_ids} - {None} for part in parts.values()]
    assert sides[0].isdisjoint(sides[1])
    assert len(sides[0] | sides[1]) == 48
    without = [sum(logs[i] is None for i in part.scenario_ids) for part in parts.values()]
    assert sum(without) == 10
    assert min(without) > 0


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:this split leaks")
def test_every_column_can_be_split_by(many):
    columns = many.sql("SELECT * FROM metadata LIMIT 0").columns
    for number, column in enumerate(columns):
        parts = many.split(None, {"a": 0.5, "b": 0.5}, by=column, prefix=f"p{number}", allow_empty=True)
        assert sum(len(part) for part in parts.values()) == 200, column


def test_wrong_splits_are_refused(many):
    with pytest.raises(BadParameter, match=r"add up to 1, found 0\.9"):
        many.split(None, {"a": 0.5, "b": 0.4})
    for wrong in ({}, {"a": 1.0, "b": 0.0}, {"a": 1.5, "b": -0.5}):
        with pytest.raises(BadParameter, match="each with a fraction above 0"):
            many.split(None, wrong)
    with pytest.raises(BadParameter, match="no column 'colour' to split by; there are scenario_id"):
        many.split(None, {"a": 1.0}, by="colour")
    with pytest.raises(BadParameter, match="is no database name"):
        many.split(None, {"a b": 1.0})
    many.split(None, {"a": 1.0})
    with pytest.raises(DatabaseExists):
        many.split(None, {"a": 0.5, "b": 0.5})
    assert many.databases == ["all_a"]


def test_there_is_one_thing_a_file():
    """Every SQL file says what it is in its first lines."""
    for path in SQL.rglob("*.sql"):
        assert path.read_text().startswith("-- "), path
