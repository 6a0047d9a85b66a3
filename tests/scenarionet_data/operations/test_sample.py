"""Samples have the requested size and proportions and are reproducible by seed."""

from __future__ import annotations

import hashlib
from collections import Counter

import pytest

from scenarionet_data.errors import BadParameter, DatabaseExists, QueryError, UnsafeSql
from tests.scenarionet_data.operations.conftest import COUNT


def column(lake, name, database):
    rows = lake.sql("SELECT * FROM metadata").to_dicts()
    known = {row["scenario_id"]: row[name] for row in rows}
    return [known[i] for i in database.scenario_ids]


@pytest.mark.parametrize(("how", "wanted"), [({"n": 25}, 25), ({"fraction": 0.1}, 12), ({"fraction": 1.0}, COUNT)])
def test_sample_has_the_requested_size(logs, how, wanted):
    found = logs.sample(None, name="few", **how)
    assert len(set(found.scenario_ids)) == len(found) == wanted
    assert found.scenario_ids == sorted(found.scenario_ids)
    assert logs.rebuild("few").is_same


def test_sample_keeps_order_and_weights_of_its_parent(logs):
    logs.filter("num_objects > 1", name="some")
    found = logs.sample("some", name="few", n=10)
    some = logs.database("some").scenario_ids
    assert found.scenario_ids == [i for i in some if i in set(found.scenario_ids)]
    assert found.lineage.parents == ["some@1"]
    assert found.lineage.parameters == {"seed": 0, "n": 10, "fraction": None}


def test_equal_seeds_draw_equal_samples(logs):
    one, two, other = (logs.sample(None, name=f"s{k}", n=30, seed=seed) for k, seed in enumerate((5, 5, 6)))
    assert one.scenario_ids == two.scenario_ids != other.scenario_ids
    larger = logs.sample(None, name="larger", n=40, seed=5)
    assert set(one.scenario_ids) < set(larger.scenario_ids)
    by_luck = sorted(range(COUNT), key=lambda k: hashlib.md5(f"5:made/v1/s{k:03d}".encode()).hexdigest())
    assert one.scenario_ids == [f"made/v1/s{k:03d}" for k in sorted(by_luck[:30])]


def test_strata_keep_their_proportions(logs):
    found = logs.sample(None, name="few", n=36, stratify="date")  # twelve days of ten
    assert set(Counter(column(logs, "date", found)).values()) == {3}
    cities = Counter(column(logs, "city", logs.sample(None, name="c", n=30, stratify="city")))
    everybody = Counter(logs.sql("SELECT city FROM metadata")["city"])
    assert all(abs(cities[city] - everybody[city] / 4) < 1 for city in everybody)


def test_balanced_values_are_equally_frequent_while_available(logs):
    found = logs.sample(None, name="few", n=30, balance="city")
    assert Counter(column(logs, "city", found)) == {"austin": 10, "boston": 10, "las vegas": 10}
    most = logs.sample(None, name="most", n=110, balance="city")
    counts = Counter(column(logs, "city", most))
    assert (counts["austin"], counts["las vegas"], counts["boston"]) == (32, 28, 50)


def test_larger_weights_are_drawn_more_often(logs):
    weights = "CASE WHEN city = 'boston' THEN 9 WHEN city = 'austin' THEN 1 ELSE 0 END"
    known = dict(logs.sql("SELECT scenario_id, city FROM metadata").rows())
    drawn = [logs.sample(None, name=f"s{k}", n=10, seed=k, weights=weights).scenario_ids for k in range(20)]
    cities = Counter(known[i] for ids in drawn for i in ids)
    assert cities["las vegas"] == 0
    assert cities["boston"] / cities["austin"] == pytest.approx(9 * 60 / 32, rel=0.5)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({}, "either a number of scenarios or a fraction"),
        ({"n": 3, "fraction": 0.5}, "either a number of scenarios or a fraction"),
        ({"n": 0}, "n: wanted a whole number of 1 or more, found 0"),
        ({"fraction": 1.5}, "fraction: wanted a number above 0 and up to 1, found 1.5"),
        ({"fraction": float("nan")}, "fraction: wanted a number above 0"),
        ({"n": 121}, "wanted 121 scenarios of 120, but only 120 can be drawn"),
        ({"n": 5, "weights": "0"}, "wanted 5 scenarios of 120, but only 0 can be drawn"),
        ({"n": 5, "balance": "colour"}, "no column 'colour' to sample by"),
        ({"n": 5, "balance": "city", "stratify": "date"}, "wanted one of stratify"),
        ({"n": 5, "balance": "city", "levels": 2}, "wanted one of stratify"),
        ({"n": 5, "levels": 0}, "levels: wanted a whole number of 1 or more, found 0"),
    ],
    ids=str,
)
def test_impossible_samples_are_refused(logs, how, says):
    with pytest.raises(BadParameter, match=says):
        logs.sample(None, name="few", **how)
    assert logs.databases == []


def test_difficulty_levels_are_equally_frequent_and_ordered(logs):
    logs.filter("num_objects > 1", name="some")
    some = logs.database("some")
    found = logs.sample("some", name="curriculum", n=12, levels=4, seed=2)
    ranked = [
        i
        for i, _ in sorted(
            zip(some.scenario_ids, column(logs, "difficulty", some), strict=True), key=lambda p: (p[1], p[0])
        )
    ]
    levels = [4 * ranked.index(i) // len(ranked) for i in found.scenario_ids]
    assert levels == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert [ranked.index(i) for i in found.scenario_ids] == sorted(ranked.index(i) for i in found.scenario_ids)
    assert logs.rebuild("curriculum").is_same


def test_weight_is_one_expression(logs):
    with pytest.raises(UnsafeSql, match="wanted one condition"):
        logs.sample(None, name="few", n=1, weights="1; DROP VIEW metadata")
    with pytest.raises(QueryError, match="no column dificulty at character 1 of 'dificulty'; similar: difficulty"):
        logs.sample(None, name="few", n=1, weights="dificulty")
    logs.sample(None, name="few", n=1)
    with pytest.raises(DatabaseExists):
        logs.sample(None, name="few", n=1)
