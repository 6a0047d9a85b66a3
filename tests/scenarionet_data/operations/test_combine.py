"""Set operations agree with Python sets; databases are renamed, copied, dropped and checked out."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarionet_data.databases import record as databases
from scenarionet_data.databases import writer
from scenarionet_data.errors import (
    BadParameter,
    DatabaseExists,
    DatabaseInUse,
    DatabaseNotFound,
    EmptyResult,
    ScenarioNotFound,
)
from scenarionet_data.query.members import StaleDatabaseWarning


def ids(numbers):
    return [f"made/v1/s{number:03d}" for number in numbers]


def make(lake, name, numbers):
    return lake.filter(name=name, ids=ids(numbers), replace=True, allow_empty=True)


NUMBERS = st.sets(st.integers(0, 20), max_size=8)


@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(a=NUMBERS, b=NUMBERS, c=NUMBERS)
def test_set_operations_match_python_sets(logs, a, b, c):
    for name, numbers in (("a", a), ("b", b), ("c", c)):
        make(logs, name, sorted(numbers))
    saving = {"replace": True, "allow_empty": True}
    merged = logs.merge("a", "b", "c", name="merged", **saving)
    assert merged.scenario_ids == ids([*sorted(a), *sorted(b - a), *sorted(c - a - b)])
    assert logs.intersect("a", "b", "c", name="both", **saving).scenario_ids == ids(sorted(a & b & c))
    assert logs.subtract("a", "b", "c", name="rest", **saving).scenario_ids == ids(sorted(a - b - c))
    for name in ("merged", "both", "rest"):
        assert logs.rebuild(name).is_same
    assert merged.lineage.parents == [logs.database(name).reference for name in "abc"]
    for name in ("merged", "both", "rest", "a", "b", "c"):
        logs.drop(name, force=True)


def test_set_operation_needs_two_databases(logs):
    make(logs, "a", [1])
    for operation in (logs.merge, logs.intersect, logs.subtract):
        with pytest.raises(BadParameter, match="wanted two databases or more, found 1"):
            operation("a", name="x")
    with pytest.raises(DatabaseNotFound, match="no database 'b'; databases: a"):
        logs.merge("a", "b", name="x")
    with pytest.raises(EmptyResult, match="x: no scenario is left of 1"):
        logs.subtract("a", "a", name="x")
    with pytest.raises(DatabaseExists, match="'a' exists; choose another name, or replace=True"):
        logs.merge("a", "a", name="a")


@pytest.mark.long
def test_databases_of_different_snapshots_are_merged_on_a_snapshot_with_all_members(changed):
    changed.filter(name="new", ids=["made/v1/s000004"])
    assert len(changed.merge("same", "new", name="both")) == 2
    with pytest.warns(StaleDatabaseWarning, match="2 of 3 members of old@1 changed after snapshot 1 and are read fr"):
        assert changed.merge("old", "same", name="earlier").lineage.snapshot == 1
    with pytest.raises(ScenarioNotFound, match=r"no snapshot has the members of old@1 and new@1 .*lake.rebase..old"):
        changed.merge("old", "new", name="never")
    assert changed.subtract("new", "old", name="unseen").scenario_ids == ["made/v1/s000004"]


def test_members_missing_from_the_lake_are_named(logs):
    made = make(logs, "a", [1, 2])
    foreign = made.members.set_column(0, "scenario_id", [["made/v1/s001", "made/v1/elsewhere"]])
    writer.save(logs.files, "foreign", foreign, made.lineage, replace=False)
    says = "members of .*foreign@1 unchanged: 1 of 2 of foreign@1 are not in snapshot 1, for example made/v1/elsewhere"
    for use in (
        lambda: logs.filter("true", name="x", database="foreign"),
        lambda: logs.sample("foreign", name="x", n=1),
        lambda: logs.merge("a", "foreign", name="x"),
        lambda: logs.resolve("foreign"),
    ):
        with pytest.raises(ScenarioNotFound, match=says.replace("of foreign@1 as", ".*foreign@1 as")):
            use()


# --- names, copies and versions ------------------------------------------------------------------------------


def test_copy_does_not_change_with_the_original(logs):
    first = make(logs, "a", [1, 2])
    copy = logs.copy("a", name="b")
    make(logs, "a", [3])
    assert logs.database("b").members.equals(first.members)
    assert copy.lineage.operation == "copy"
    assert copy.lineage.parents == ["a@1"]
    assert logs.rebuild("b").is_same
    assert logs.copy("a@1", name="c").scenario_ids == ids([1, 2])
    with pytest.raises(DatabaseExists):
        logs.copy("a", name="b")
    make(logs, "none", [])
    assert len(logs.copy("none", name="none_too")) == 0


def test_renaming_moves_all_versions(logs):
    make(logs, "a", [1])
    make(logs, "a", [2])
    make(logs, "c", [3])
    with pytest.raises(DatabaseExists, match="'c' exists"):
        logs.rename("a", name="c")
    with pytest.raises(BadParameter, match="is no database name"):
        logs.rename("a", name="../c")
    with pytest.raises(DatabaseNotFound):
        logs.rename("x", name="y")
    logs.rename("a", name="b")
    assert logs.files.verify("databases/b/1.parquet")
    assert logs.databases == ["b", "c"]
    assert logs.database("b@1").scenario_ids == ids([1])
    assert logs.database("b").scenario_ids == ids([2])
    logs.filter("true", name="child", database="b")
    with pytest.raises(DatabaseInUse, match=r"child@1 was made from b; lake.copy..b., name=.d.. keeps it"):
        logs.rename("b", name="d")


def test_dropping_a_database_with_dependants_is_refused(logs):
    make(logs, "a", [1])
    make(logs, "a", [2])
    logs.filter("true", name="child", database="a@1")
    with pytest.raises(DatabaseInUse, match=r"child@1 was made from a; drop those first, or force=True"):
        logs.drop("a")
    with pytest.raises(DatabaseInUse):
        logs.drop("a@1")
    logs.drop("a@2")  # no database depends on this one
    assert logs.database("a").reference == "a@1"
    logs.drop("a", force=True)
    assert logs.databases == ["child"]
    assert len(logs.database("child")) == 1
    with pytest.raises(DatabaseNotFound, match="no database 'a'; databases: child"):
        logs.drop("a")
    assert list((logs.root / ".tmp").iterdir()) == []


def test_five_dependants_are_named(logs):
    make(logs, "a", [1])
    for number in range(6):
        logs.filter("true", name=f"child{number}", database="a")
    named = ", ".join(f"child{number}@1" for number in range(5))
    with pytest.raises(DatabaseInUse, match=f"^{named} were made from a; "):
        logs.drop("a")


def test_dropping_the_last_version_frees_the_name(logs):
    make(logs, "a", [1])
    logs.drop("a@1")
    assert logs.databases == []


def test_old_version_is_checked_out_with_its_lineage(logs):
    first, second = make(logs, "a", [1]), make(logs, "a", [2])
    back = logs.checkout("a@1")
    assert back.reference == "a@3"
    assert back.members.equals(first.members)
    assert logs.database("a@3").lineage == logs.database("a@1").lineage
    assert logs.database("a@2").members.equals(second.members)
    assert logs.rebuild("a").is_same
    with pytest.raises(BadParameter, match="wanted an old version, for example a@1"):
        logs.checkout("a")
    with pytest.raises(DatabaseNotFound, match=r"no database 'a@7'; versions \[1, 2, 3\]"):
        logs.checkout("a@7")


def test_concurrent_saves_of_one_name_conflict_unless_replacing(logs):
    made = make(logs, "a", [1, 2])

    def save(name, replace):
        try:
            return writer.save(logs.files, name, made.members, made.lineage, replace=replace).version
        except DatabaseExists:
            return None

    with ThreadPoolExecutor(8) as pool:
        assert sorted(filter(None, pool.map(lambda _: save("one", False), range(8)))) == [1]
        assert sorted(pool.map(lambda _: save("many", True), range(8))) == list(range(1, 9))
    assert databases.versions(logs.files, "one") == [1]
    assert databases.versions(logs.files, "many") == list(range(1, 9))
    assert len(logs.database("many")) == 2
