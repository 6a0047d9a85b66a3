"""Filters by id list and by name, and errors for invalid conditions."""

from __future__ import annotations

import re

import pytest

from scenarionet_data.errors import BadParameter, EmptyResult, QueryError, ScenarioNotFound, UnsafeSql


def ids(*numbers):
    return [f"made/v1/s{number:03d}" for number in numbers]


def test_id_list_selects_exactly_these_scenarios(logs):
    found = logs.filter(name="some", ids=["made/v1/s010", "r011", "made/v1/s002"])  # r011: the id in the source
    assert found.scenario_ids == ids(2, 10, 11)
    assert found.lineage.parameters["f0_ids"] == ["made/v1/s010", "r011", "made/v1/s002"]
    both = logs.filter("scenario_id > 'made/v1/s005'", name="fewer", ids=ids(2, 10), database="some")
    assert both.scenario_ids == ids(10)


@pytest.mark.parametrize("part", ["r01", "made/v1/s01", "010", "made/v1/s0100", ""])
def test_partial_ids_do_not_match(logs, part):
    with pytest.raises(ScenarioNotFound, match="1 of 2 ids are not in snapshot 1, for example"):
        logs.filter(name="some", ids=[part, "r010"])
    assert logs.databases == []


def test_ids_are_resolved_in_the_parent(logs):
    logs.filter(name="low", ids=ids(1, 2, 3))
    with pytest.raises(ScenarioNotFound, match=r"1 of 2 ids are not in low@1, for example made/v1/s004; wanted whole"):
        logs.filter(name="some", ids=ids(3, 4), database="low")


def test_empty_id_list_selects_no_scenarios(logs):
    with pytest.raises(EmptyResult):
        logs.filter(name="none", ids=[])
    assert len(logs.filter(name="none", ids=[], allow_empty=True)) == 0


@pytest.mark.parametrize(
    ("named", "where"),
    [
        ("object_type:type=vehicle,min=2", "num_vehicles >= 2"),
        ("object_type:min=0", "num_pedestrians >= 0"),
        ("object_type:type=CYCLIST", "num_cyclists >= 1"),
        ("object_type:type=cone,min=0,max=0", "num_cones = 0"),
        ("object_type:type=barrier,min=0", "num_barriers >= 0"),
        ("object_type:type=other,min=0", "true"),
        ("object_count:max=3", "num_objects <= 3"),
        ("speed:min=9,max=11", "ego_mean_speed BETWEEN 9 AND 11"),
        ("max_speed:min=1", "ego_max_speed >= 1"),
        ("curvature:max=1", "ego_cumulative_curvature <= 1"),
        ("difficulty:max=1000", "difficulty <= 1000"),
        ("ids:ids=r001 r002", "source_scenario_id IN ('r001', 'r002')"),
        ("no_traffic_light", "true"),
    ],
)
def test_named_filters_match_their_sql(logs, named, where):
    wanted = logs.sql(f"SELECT scenario_id FROM metadata WHERE {where} ORDER BY 1")["scenario_id"].to_list()
    assert wanted
    assert logs.filter(name="kept", filters=[named]).scenario_ids == wanted


def test_unknown_object_type_is_named(logs):
    with pytest.raises(QueryError, match=r"object_type: wanted vehicle, pedestrian, .* found train"):
        logs.filter(name="x", filters=["object_type:type=train"])


@pytest.mark.parametrize(
    ("where", "says"),
    [
        ("ego_distance > > 10", r'at or near ">" \(character 16\)'),
        ("ego_distance > 10 AN num_objects > 2", r'at or near "num_objects" \(character 22\)'),
        ("städte = 1 AND AND", r'at or near "AND" \(character 16\)'),
        ("'open", r"unterminated .* \(character 1\)"),
    ],
)
def test_syntax_error_has_a_position(logs, where, says):
    with pytest.raises(UnsafeSql, match=says):
        logs.filter(where, name="x")


@pytest.mark.parametrize(
    ("where", "says"),
    [
        ("ego_distanse > 10", "no column ego_distanse at character 1 of .*; similar: ego_distance"),
        ("has_z AND\n num_object > 2", "no column num_object at character 12 of .*; similar: num_objects"),
        ("xyzzy = 1", "no column xyzzy at character 1 of 'xyzzy = 1'; `scenarionet info filters --columns` explains"),
    ],
)
def test_unknown_column_has_a_position_and_a_suggestion(logs, where, says):
    with pytest.raises(QueryError, match=says):
        logs.filter(where, name="x")


def test_condition_cannot_write_to_the_lake(logs):
    before = sorted(logs.root.rglob("*"))
    for where in (f"(COPY (SELECT 1) TO '{logs.root}/x')", f"EXISTS (COPY (SELECT 1) TO '{logs.root}/x')"):
        with pytest.raises(QueryError):
            logs.filter(where, name="x")
        with pytest.raises(QueryError):
            logs.sample(None, name="x", n=1, weights=where)
    with pytest.raises(QueryError):
        logs.sql(f"COPY (SELECT 1) TO '{logs.root}/x'")
    assert sorted(logs.root.rglob("*")) == before


def test_missing_parameter_is_named(logs):
    with pytest.raises(QueryError, match="far"):
        logs.filter("ego_distance > $far", name="x")
    with pytest.raises(BadParameter, match="a parameter is a number, a text"):
        logs.filter("ego_distance > $far", name="x", parameters={"far": object()})


def test_selections_may_be_empty(logs):
    none, some = logs.select("false"), logs.select("scenario_id < 'made/v1/s002'")
    assert len(none) == 0 and none.members.schema == some.members.schema
    assert none.scenario_ids == [] and some.scenario_ids == ids(0, 1)


def test_the_hardest_come_first(logs):
    rows = logs.sql("SELECT scenario_id, num_objects FROM metadata").rows()
    expected = sorted(rows, key=lambda row: (-row[1], row[0]))
    hardest = logs.filter(name="hardest", order_by="num_objects DESC", limit=5)
    assert hardest.scenario_ids == [scenario_id for scenario_id, _ in expected[:5]]
    assert logs.rebuild(hardest).is_same
    assert (
        logs.select(order_by="num_objects", limit=len(rows)).scenario_ids[0] == min(rows, key=lambda r: (r[1], r[0]))[0]
    )
    within = logs.select("scenario_id <= 'made/v1/s003'", order_by="scenario_id DESC", limit=2, database="hardest")
    assert within.scenario_ids == sorted((s for s in hardest.scenario_ids if s <= ids(3)[0]), reverse=True)[:2]
    assert logs.select(limit=3).scenario_ids == ids(0, 1, 2)


def test_unknown_values_come_last(logs):
    order = "CASE WHEN scenario_id <> 'made/v1/s000' THEN num_objects END"
    for direction in ("", " desc", " ASC"):
        found = logs.select(ids=ids(0, 1, 2), order_by=order + direction)
        assert found.scenario_ids[-1] == ids(0)[0]


def test_events_are_ranked_last(logs):
    found = logs.select(events=["closest_approach"], order_by="scenario_id DESC")
    every = logs.select(events=["closest_approach"])
    assert len(every) > 1
    assert found.scenario_ids == sorted(every.scenario_ids, reverse=True)
    assert (
        logs.select(events=["closest_approach"], order_by="scenario_id DESC", limit=1).scenario_ids
        == found.scenario_ids[:1]
    )


@pytest.mark.parametrize(
    ("order", "limit", "says"),
    [
        ("num_objects; DROP TABLE x", None, "wanted one condition"),
        ("num_objects) LIMIT (1", None, "wanted one condition"),
        (" desc", None, "wanted one condition"),
        (7, None, "wanted SQL as text, found 7"),
        (None, 0, "limit=0; expected a whole number of 1 or more"),
        (None, "20", "limit='20'; expected"),
        (None, True, "limit=True; expected"),
    ],
)
def test_orders_that_are_none_are_refused(logs, order, limit, says):
    with pytest.raises((UnsafeSql, QueryError, BadParameter), match=re.escape(says)):
        logs.select(order_by=order, limit=limit)
