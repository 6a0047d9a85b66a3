"""Splits: disjoint, exhaustive, exact where documented, reproducible by seed; leaks are reported."""

from __future__ import annotations

import hashlib
from collections import Counter
from itertools import pairwise
from math import ceil

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from scenarionet_data.errors import BadParameter, DatabaseExists, EmptyResult, LeakingSplit
from scenarionet_data.operations import split
from scenarionet_data.operations.split import LeakWarning
from tests.scenarionet_data.operations.conftest import COUNT

pytestmark = pytest.mark.filterwarnings("ignore:this split leaks")


def facts(lake):
    return {row["scenario_id"]: row for row in lake.sql("SELECT * FROM metadata").to_dicts()}


def check_whole(parts, count=COUNT):
    """Check that the parts are disjoint and exhaustive, and that each lineage rebuilds its part."""
    everybody = [i for part in parts.values() for i in part.scenario_ids]
    assert len(everybody) == len(set(everybody)) == count
    for part in parts.values():
        assert part.scenario_ids == sorted(part.scenario_ids)


def check_rebuilds(lake, parts):
    for part in parts.values():
        assert lake.rebuild(part.reference).is_same, part.lineage.sql


@pytest.mark.parametrize(
    "how",
    [
        pytest.param({"fractions": {"a": 0.7, "b": 0.3}}, marks=pytest.mark.long),
        {"fractions": {"a": 0.7, "b": 0.3}, "by": "source_log"},
        pytest.param({"fractions": {"a": 0.5, "b": 0.3, "c": 0.2}, "stratify": "city"}, marks=pytest.mark.long),
        {"fractions": {"a": 0.5, "b": 0.5}, "stratify": "city", "by": "source_log"},
        {"fractions": {"a": 0.5, "b": 0.5}, "along": "date"},
        {"levels": 7},
        pytest.param({"each": "city"}, marks=pytest.mark.long),
    ],
    ids=str,
)
def test_every_split_is_complete_and_can_be_rebuilt(logs, how):
    parts = logs.split(None, **how)
    check_whole(parts)
    check_rebuilds(logs, parts)
    logs.filter("num_objects > 2", name="some")
    parts = logs.split("some", **how)
    check_whole(parts, len(logs.database("some")))
    check_rebuilds(logs, parts)


def test_strata_keep_their_proportions_exactly(logs):
    fractions = {"a": 0.5, "b": 0.3, "c": 0.2}
    parts = logs.split(None, fractions, stratify="date")
    known = facts(logs)
    for part, share in (("a", 5), ("b", 3), ("c", 2)):  # twelve days of ten
        days = Counter(known[i]["date"] for i in parts[part].scenario_ids)
        assert days == dict.fromkeys({row["date"] for row in known.values()}, share)
    again = logs.split(None, fractions, stratify="date", name="again")
    other = logs.split(None, fractions, stratify="date", name="other", seed=1)
    assert again["a"].scenario_ids == parts["a"].scenario_ids != other["a"].scenario_ids


def test_small_strata_are_distributed_over_all_parts(logs):
    """Each scenario is a stratum of its own."""
    parts = logs.split(None, {"a": 0.5, "b": 0.5}, stratify="scenario_id")
    assert 40 < len(parts["a"]) < 80


def test_log_strata_keep_logs_together(logs):
    parts = logs.split(None, {"a": 0.5, "b": 0.5}, stratify="city", by="source_log", strict=True)
    known = facts(logs)
    sides = [{known[i]["source_log"] for i in part.scenario_ids} - {None} for part in parts.values()]
    assert sides[0].isdisjoint(sides[1])
    for part in parts.values():
        assert Counter(known[i]["city"] for i in part.scenario_ids)["boston"] == pytest.approx(30, abs=4)


def test_date_order_puts_earlier_scenarios_first(logs):
    parts = logs.split(None, {"past": 0.7, "recent": 0.3}, along="date")
    known = facts(logs)
    days = [{known[i]["date"] for i in parts[part].scenario_ids} for part in ("past", "recent")]
    assert max(days[0]) < min(days[1])
    assert abs(len(parts["past"]) - 0.7 * COUNT) <= 10  # a day is not divided


def test_levels_have_rising_difficulty_and_equal_size(logs):
    parts = logs.split(None, levels=7)
    assert list(parts) == [f"level{k}" for k in range(1, 8)]
    known = facts(logs)
    difficulty = [[known[i]["difficulty"] for i in part.scenario_ids] for part in parts.values()]
    for easy, hard in pairwise(difficulty):
        assert max(easy) <= min(hard)
    assert {len(level) for level in difficulty} <= {17, 18}
    by_size = logs.split(None, levels=2, along="num_objects", name="size")
    sizes = [[known[i]["num_objects"] for i in level.scenario_ids] for level in by_size.values()]
    assert max(sizes[0]) <= min(sizes[1])
    assert [len(level) for level in sizes] == [60, 60]


def test_each_value_becomes_a_part(logs):
    parts = logs.split(None, each="city")
    assert {part: len(made) for part, made in parts.items()} == Counter(row["city"] for row in facts(logs).values())
    assert logs.databases == ["all_austin", "all_boston", "all_las_vegas"]
    logs.split(None, each="source_log", name="log")
    assert "log_none" in logs.databases
    with pytest.raises(BadParameter, match="scenario_id has more than 100 values"):
        logs.split(None, each="scenario_id")


@given(counts=st.lists(st.integers(1, 30), min_size=1, max_size=6))
def test_upper_bounds_rise_to_one(counts):
    whole = sum(counts)
    bounds = split.upper_bounds({str(k): count / whole for k, count in enumerate(counts)})
    assert bounds == sorted(bounds)
    assert bounds[-1] == 1.0
    assert len(bounds) == len(counts)


def test_parts_by_hash_are_those_of_the_first_versions(logs):
    parts = logs.split(None, {"a": 0.8, "b": 0.1, "c": 0.1}, seed=3, by="source_log")
    for row in facts(logs).values():
        group = row["source_log"] or row["scenario_id"]
        share = int(hashlib.md5(f"3:{group}".encode()).hexdigest()[:13], 16) / 2**52
        part = "a" if share < 0.8 else "b" if share < 0.9 else "c"
        assert row["scenario_id"] in parts[part].scenario_ids


@example(bound=1.0, off=-1)
@example(bound=1 - 2**-53, off=-1)
@example(bound=1e-20, off=0)
@given(bound=st.floats(0, 1, exclude_min=True), off=st.integers(-2, 2))
def test_texts_are_below_a_bound_as_their_numbers_are(bound, off):
    bits = min(max(ceil(bound * 2**52) + off, 0), 2**52 - 1)
    for rest in ("0" * 19, "f" * 19):
        assert (f"{bits:013x}{rest}" < split.as_hexadecimal(bound)) == (bits / 2**52 < bound)


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10**6), first=st.sampled_from([0.1, 0.25, 0.5, 0.8]))
def test_any_seed_and_fraction_partitions_the_lake(logs, seed, first):
    parts = logs.split(None, {"a": first, "b": 1 - first}, seed=seed, by="source_log", replace=True, allow_empty=True)
    check_whole(parts)


# --- leaks --------------------------------------------------------------------------------------------------


def test_leak_is_reported_before_saving(logs):
    with pytest.warns(LeakWarning, match=r"2\d source logs with \d+ scenarios .*by=.source_log"):
        logs.split(None, {"a": 0.5, "b": 0.5})
    assert logs.databases == ["all_a", "all_b"]
    with pytest.raises(LeakingSplit, match="this split leaks"):
        logs.split(None, {"a": 0.5, "b": 0.5}, name="strict", strict=True)
    assert logs.databases == ["all_a", "all_b"]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("how", [{"by": "source_log"}, {"by": "city", "allow_empty": True}])
def test_split_that_keeps_logs_together_is_not_reported(logs, how):
    logs.split(None, {"a": 0.5, "b": 0.5}, strict=True, **how)


# --- invalid arguments ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({}, "wanted one of fractions"),
        ({"fractions": {"a": 1.0}, "levels": 2}, "wanted one of fractions"),
        ({"levels": 2, "each": "city"}, "wanted one of fractions"),
        ({"levels": 0}, "levels: wanted a whole number of 1 or more"),
        ({"levels": 2, "stratify": "city"}, "stratify goes with fractions alone"),
        ({"fractions": {"a": 1.0}, "stratify": "city", "along": "date"}, "stratify goes with fractions alone"),
        ({"each": "city", "along": "date"}, "leave along out"),
        ({"each": "colour"}, "no column 'colour' to split by"),
        ({"fractions": {"a": 1.0}, "stratify": "colour"}, "no column 'colour' to stratify by"),
        ({"fractions": {"a": 1.0}, "along": "colour"}, "no column 'colour' to split along"),
        ({"fractions": {"a": 1.0}, "along": "source_log"}, '10 of 120 scenarios have no source_log: filter by "source'),
        ({"fractions": {"a": float("nan")}}, "each with a fraction above 0"),
    ],
    ids=str,
)
def test_invalid_split_arguments_are_refused(logs, how, says):
    with pytest.raises(BadParameter, match=says):
        logs.split(None, **how)
    assert logs.databases == []


def test_empty_part_or_existing_name_saves_nothing(logs):
    logs.filter(name="one", ids=["r001"])
    with pytest.raises(EmptyResult, match=r"no scenario of 1 falls into (a|b); other fractions"):
        logs.split("one", {"a": 0.5, "b": 0.5})
    logs.filter(name="x_b", ids=["r001"])
    with pytest.raises(DatabaseExists, match="'x_b' exists; choose another name, or replace=True"):
        logs.split(None, {"a": 0.5, "b": 0.5}, name="x")
    assert logs.databases == ["one", "x_b"]
    parts = logs.split(None, {"a": 0.5, "b": 0.5}, name="x", replace=True)
    assert [part.reference for part in parts.values()] == ["x_a@1", "x_b@2"]
