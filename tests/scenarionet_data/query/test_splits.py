"""Splits are disjoint, exhaustive and reproducible."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import replace

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import (
    BadParameter,
    DatabaseExists,
)
from scenarionet_data.schema.package_data import SQL
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed


@pytest.fixture(scope="module")
def log_lake(tmp_path_factory):
    """200 scenarios of 50 logs, four each; the last 10 have no log."""
    template = make_scenario(1, num_objects=1, num_steps=2, num_lanes=0, num_lights=0, has_map=False)
    made = [renamed(template, f"s{k:03d}") for k in range(200)]
    logs = [f"log{k // 4}" if k < 190 else None for k in range(200)]
    return write_lake(
        tmp_path_factory.mktemp("logs"),
        [replace(s, source=replace(s.source, log=log)) for s, log in zip(made, logs, strict=True)],
    )


@pytest.fixture
def many(log_lake, tmp_path):
    """A writable copy of the lake."""
    shutil.copytree(log_lake.root, tmp_path / "lake")
    return Lake(tmp_path / "lake")


def fraction(seed, group):
    """The split's hash fraction, computed independently."""
    return int(hashlib.md5(f"{seed}:{group}".encode()).hexdigest()[:13], 16) / 2**52


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_split_is_disjoint_exhaustive_and_md5_based(many):
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
def test_split_is_stable_across_versions(many):
    """Frozen reference values, valid on any machine and with any DuckDB version."""
    parts = many.split(None, {"train": 0.9, "val": 0.1}, seed=0)
    val = "002 018 037 039 040 045 047 055 064 066 084 091 094 114 117 119 146 151 161 185 186 188 194"
    assert [i[-3:] for i in parts["val"].scenario_ids] == val.split()


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_scenario_keeps_its_part_as_the_lake_grows(many):
    before = many.split(None, {"a": 0.5, "b": 0.5}, name="x")
    template = make_scenario(1, num_objects=1, num_steps=2, num_lanes=0, num_lights=0, has_map=False)
    grown = write_lake(many.root, [renamed(template, f"new{k}") for k in range(50)], name="more")
    after = grown.split(None, {"a": 0.5, "b": 0.5}, name="x", replace=True)
    for part in "ab":
        assert set(before[part].scenario_ids) < set(after[part].scenario_ids)


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_different_seed_gives_different_split(many):
    zero, one = (many.split(None, {"a": 0.5, "b": 0.5}, seed=s, name=f"s{s}")["a"].scenario_ids for s in (0, 1))
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
def test_every_column_can_be_a_split_key(many):
    columns = many.sql("SELECT * FROM metadata LIMIT 0").columns
    for number, column in enumerate(columns):
        parts = many.split(None, {"a": 0.5, "b": 0.5}, by=column, name=f"p{number}", allow_empty=True)
        assert sum(len(part) for part in parts.values()) == 200, column


def test_invalid_splits_are_refused(many):
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


def test_every_sql_file_has_a_header_comment():
    """Every SQL file states its purpose in its first lines."""
    for path in SQL.rglob("*.sql"):
        assert path.read_text().startswith("-- "), path
