"""Named, versioned databases; databases of an older snapshot are detected as stale."""

from __future__ import annotations

import warnings

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import (
    BadParameter,
    DatabaseExists,
    DatabaseNotFound,
    EmptyResult,
    NoSuchSnapshot,
    ScenarioNotFound,
)
from scenarionet_data.query.members import StaleDatabaseWarning
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import NUM_VARIED


def test_databases_are_versioned_and_not_overwritten_by_default(own):
    first = own.filter("num_objects > 3", name="busy")
    with pytest.raises(DatabaseExists, match="replace=True"):
        own.filter("num_objects > 4", name="busy")
    second = own.filter("num_objects > 4", name="busy", replace=True)
    assert (first.reference, second.reference) == ("busy@1", "busy@2")
    assert own.databases == ["busy"]
    assert own.database("busy").scenario_ids == second.scenario_ids != first.scenario_ids
    assert own.database("busy@1").scenario_ids == first.scenario_ids
    assert len(ScenarioLoader(own, "busy@1")) == len(first)


@pytest.mark.parametrize("name", ["", "a b", "../x", "a/b", ".x", "-x", "ü", "a@1"])
def test_invalid_database_names_are_refused(own, name):
    with pytest.raises(BadParameter, match="is no database name"):
        own.filter("true", name=name)


def test_missing_database_error_lists_existing_ones(own):
    with pytest.raises(DatabaseNotFound, match="no database 'x'; databases: none yet"):
        own.database("x")
    own.filter("true", name="all")
    with pytest.raises(DatabaseNotFound, match="no database 'x'; databases: all"):
        own.filter("true", name="y", database="x")
    with pytest.raises(DatabaseNotFound, match=r"no database 'all@7'; versions \[1\]"):
        own.database("all@7")
    with pytest.raises(BadParameter, match="wanted name or name@version, with a number"):
        own.database("all@new")


def test_empty_database_is_saved_only_on_request(own):
    with pytest.raises(EmptyResult, match=rf"none: no scenario is left of {NUM_VARIED}; loosen the conditions, or al"):
        own.filter("false", name="none")
    assert own.databases == []
    none = own.filter("false", name="none", allow_empty=True)
    assert len(none) == 0
    assert len(own.filter("true", name="still", database="none", allow_empty=True)) == 0
    assert len(ScenarioLoader(own, "none")) == 0
    with pytest.raises(EmptyResult, match="no scenario of 0 falls into a, b; other fractions, another seed, or al"):
        own.split("none", {"a": 0.5, "b": 0.5})
    parts = own.split("none", {"a": 0.5, "b": 0.5}, allow_empty=True)
    assert [len(part) for part in parts.values()] == [0, 0]


def test_scenarios_are_located_in_requested_order(own):
    ids = own.sql("SELECT scenario_id FROM metadata ORDER BY 1 DESC")["scenario_id"].to_list()
    assert own.resolve([*ids, ids[0]])[1]["scenario_id"].to_pylist() == [*ids, ids[0]]
    with pytest.raises(ScenarioNotFound, match="no scenario made/v1/x in snapshot 1; 1 of 2 are missing"):
        own.resolve([ids[0], "made/v1/x"])


@pytest.fixture
def changed(tmp_path):
    """Database ``old`` has members that were replaced since it was saved; the member of ``same`` is unchanged."""
    raw = write_raw(tmp_path / "raw", {"a": [1, 2], "b": [3]})
    root = tmp_path / "lake"
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=2))
    Lake(root).filter("true", name="old")
    Lake(root).filter("ends_with(scenario_id, '3')", name="same")
    (raw / "a.made").write_text("1\n4")
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=2), replace=True)
    return Lake(root)


def test_stale_database_is_read_from_its_snapshot_with_a_warning(changed):
    assert changed.snapshot.number > 1
    with pytest.warns(StaleDatabaseWarning, match=r"1 of 3 members of old@1 changed after snapshot 1"):
        loader = ScenarioLoader(changed, "old")
    assert [scenario.id[-1] for scenario in loader] == ["1", "2", "3"]


@pytest.mark.long
def test_databases_derived_from_a_stale_one_are_readable(changed):
    with pytest.warns(StaleDatabaseWarning):
        child = changed.filter("true", name="child", database="old")
    with pytest.warns(StaleDatabaseWarning):
        parts = changed.split("old", {"a": 0.5, "b": 0.5}, allow_empty=True)
    assert child.lineage.snapshot == 1
    assert {part.lineage.snapshot for part in parts.values()} == {1}
    with pytest.warns(StaleDatabaseWarning):
        assert len(list(ScenarioLoader(changed, "child"))) == 3


def test_database_of_unchanged_members_follows_the_lake(changed):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [scenario.id[-1] for scenario in ScenarioLoader(changed, "same")] == ["3"]


def test_database_with_missing_snapshot_names_missing_members(changed):
    changed.files.path("snapshots/00000001.json").unlink()
    remedy = (
        r"old@1 was made on snapshot 1, which has expired, and some of its members have changed since; lake.rebase\("
    )
    with pytest.raises(NoSuchSnapshot, match=remedy):
        ScenarioLoader(changed, "old")


def test_databases_are_equal_through_different_handles(own):
    saved = own.filter("num_objects > 3", name="busy")
    assert Lake(own.root).database("busy") == own.database("busy") == saved
