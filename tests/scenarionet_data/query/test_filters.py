"""Members of filtered databases, valid conditions, and the recorded lineage."""

from __future__ import annotations

import datetime
import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data.databases import writer
from scenarionet_data.errors import (
    BadParameter,
    QueryError,
    UnknownFilter,
    UnsafeSql,
)
from scenarionet_data.query.named_sql import FILTERS
from tests.fixtures import oracle
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import NUM_VARIED, make_scenario, varied


def test_filter_keeps_matches_in_order_of_id(own):
    found = own.filter("num_objects > 3 AND ego_distance > $far", name="busy", parameters={"far": 1.0})
    wanted = own.sql("SELECT scenario_id FROM metadata WHERE num_objects > 3 AND ego_distance > 1.0 ORDER BY 1")
    assert 0 < len(found) < NUM_VARIED
    assert found.scenario_ids == wanted["scenario_id"].to_list()
    assert found.members["position"].to_pylist() == list(range(len(found)))
    assert found.members["weight"].to_pylist() == [1.0] * len(found)
    assert own.database("busy").members.equals(found.members)


def test_lineage_records_how_a_database_was_made(own):
    own.filter("num_objects > 2", name="some")
    made = own.filter("ego_distance > $far", name="few", database="some", parameters={"far": 0.5})
    lineage = own.database("few").lineage
    assert lineage == made.lineage
    assert (lineage.operation, lineage.parents, lineage.snapshot) == ("filter", ["some@1"], 1)
    assert lineage.parameters == {"far": 0.5}
    assert "ego_distance > $far" in lineage.sql
    assert lineage.count == len(made)
    assert lineage.created_with
    assert own.database("few").lineage == lineage


def test_lineage_with_parameters_can_be_run_again(own):
    made = own.filter("date IS NULL OR date::DATE > $day::DATE", name="recent", parameters={"day": "2024-05-17"})
    assert own.database("recent").lineage.parameters == {"day": "2024-05-17"} == made.lineage.parameters
    with pytest.raises(BadParameter, match=r"pass a date as text and compare with \$name::DATE"):
        own.filter("date::DATE > $day", name="never", parameters={"day": datetime.date(2024, 5, 17)})


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_filter_of_a_database_keeps_its_order_and_weights(own):
    ids = [scenario.id for scenario in varied()][::-1]
    hashes = {row["scenario_id"]: row["content_hash"] for row in own.sql("SELECT * FROM metadata").to_dicts()}
    members = pa.table(
        {
            "scenario_id": ids,
            "weight": np.arange(NUM_VARIED, dtype=np.float64),
            "content_hash": pa.array([hashes[i] for i in ids], pa.uint64()),
        }
    )
    lineage = replace(own.filter("true", name="any").lineage, operation="by hand")
    writer.save(own.files, "backwards", members, lineage, replace=False)
    kept = own.filter("num_objects > 2", name="kept", database="backwards")
    large = set(own.filter("num_objects > 2", name="all").scenario_ids)
    wanted = [i for i in ids if i in large]
    assert kept.scenario_ids == wanted
    weights = dict(zip(ids, range(NUM_VARIED), strict=True))
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
def test_condition_is_one_expression_over_the_lake(lake, where):
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
def test_condition_may_query_other_tables(own, where):
    assert 0 < len(own.filter(where, name="some")) <= NUM_VARIED


def test_named_filters_add_conditions(own):
    found = own.filter(
        "num_lights >= $n", name="x", filters=["ego_distance:min=1", "object_count:min=3"], parameters={"n": 1}
    )
    wanted = own.filter("num_lights >= 1 AND ego_distance >= 1 AND num_objects >= 3", name="y")
    assert 0 < len(found) < NUM_VARIED
    assert found.scenario_ids == wanted.scenario_ids
    assert found.lineage.parameters["f0_min"] == 1.0


@pytest.mark.long
@pytest.mark.parametrize("name", FILTERS.names())
def test_every_named_filter_runs_and_is_documented(lake, name, tmp_path):
    found, values = FILTERS.parse(name)
    assert found.doc.endswith(".")
    assert values == found.defaults
    assert not re.findall(r"\$(?!" + "|".join([*values, "$"]) + r")\w+", found.text)
    own = write_lake(tmp_path, [make_scenario(k, num_lights=k) for k in range(2)])
    assert 0 <= len(own.filter(name="kept", filters=[name], allow_empty=True)) <= 2


def test_unknown_filters_and_parameters_are_named(lake):
    with pytest.raises(UnknownFilter, match="ego_distance"):
        lake.filter(name="x", filters=["ego_distanse"])
    with pytest.raises(BadParameter, match="has no parameter 'least'; it has min, max"):
        lake.filter(name="x", filters=["ego_distance:least=3"])
    with pytest.raises(BadParameter, match="min wants float, found 'three'"):
        lake.filter(name="x", filters=["ego_distance:min=three"])


def test_filters_select_the_documented_scenarios(tmp_path):
    flat = make_scenario(1, has_z=False)
    hilly = make_scenario(2)
    dark = make_scenario(3, num_lights=0)
    own = write_lake(tmp_path, [flat, hilly, dark])
    statistics = {s.id: oracle.statistics(s) for s in (flat, hilly, dark)}

    def kept(name):
        return set(own.filter(name="kept", filters=[name], replace=True).scenario_ids)

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
