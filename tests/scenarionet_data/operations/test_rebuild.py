"""Rebuild from lineage, rebase to a newer snapshot, and diff."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.databases import writer
from scenarionet_data.errors import BadParameter, DatabaseNotFound, NoSuchSnapshot
from scenarionet_data.query.members import StaleDatabaseWarning
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.integrity import seals
from tests.scenarionet_data.operations.conftest import COUNT

ONE, TWO, THREE, FOUR = (f"made/v1/s00000{k}" for k in (1, 2, 3, 4))


# --- rebuild -------------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_every_operation_can_be_rebuilt(logs):
    logs.filter("num_objects >= $n", name="a", filters=["speed:min=1", "no_overpass"], parameters={"n": 2}, ids=None)
    logs.filter(name="b", database="a", ids=logs.database("a").scenario_ids[::2])
    logs.split("a", {"x": 0.5, "y": 0.5}, seed=9)
    logs.sample("a", name="c", n=10, stratify="city", weights="difficulty + 1")
    logs.merge("b", "c", name="d")
    logs.subtract("a", "d", name="e")
    logs.copy("e", name="f")
    for name in logs.databases:
        rebuilt = logs.rebuild(name)
        assert rebuilt.is_same, name
        assert rebuilt.diff.is_same


def test_old_databases_are_rebuilt_on_their_own_snapshot(changed):
    assert changed.rebuild("old").is_same
    assert changed.rebuild("child@1").is_same


def test_rebuild_detects_altered_lineage(logs):
    made = logs.filter("num_objects > 1", name="a")
    for number, wrong in enumerate(("num_objects > 2", "num_objects > 0")):
        lineage = replace(made.lineage, sql=made.lineage.sql.replace("num_objects > 1", wrong))
        writer.save(logs.files, f"b{number}", made.members, lineage, replace=False)
        rebuilt = logs.rebuild(f"b{number}")
        assert not rebuilt.is_same
        assert not rebuilt.diff.is_same
    backwards = made.members.take(list(range(len(made)))[::-1])
    writer.save(logs.files, "c", backwards, made.lineage, replace=False)
    rebuilt = logs.rebuild("c")
    assert rebuilt.diff.is_same
    assert not rebuilt.is_same


def test_rebuild_error_names_the_reason(changed):
    changed.files.path("snapshots/00000001.json").unlink()
    remedy = r"old@1 cannot be made again as it was: .*no snapshot 1.*lake.rebase.*keep_members=True"
    with pytest.raises(NoSuchSnapshot, match=remedy):
        changed.rebuild("old")
    changed.filter("true", name="all")
    changed.filter("true", name="orphan", database="all")
    changed.drop("all", force=True)
    with pytest.raises(DatabaseNotFound, match=r"orphan@1 cannot be made again as it was: .*no database 'all@1'"):
        changed.rebuild("orphan")


# --- rebase --------------------------------------------------------------------------------------------------


def test_rebase_runs_the_query_again(changed):
    (diff,) = changed.rebase("old")
    assert (diff.before, diff.after, diff.counts) == ("old@1", "old@2", (3, 3))
    assert (diff.ids("came"), diff.ids("went"), diff.ids("changed")) == ([FOUR], [TWO], [ONE])
    assert [scenario.id for scenario in ScenarioLoader(changed, "old")] == [ONE, THREE, FOUR]
    assert changed.database("old").lineage.sql == changed.database("old@1").lineage.sql
    assert changed.rebase("old") == []
    assert changed.rebuild("old").is_same


@pytest.mark.long
def test_rebase_moves_parents_first(changed):
    diffs = changed.rebase("child")
    assert [diff.after for diff in diffs] == ["old@2", "child@2"]
    assert changed.database("child").lineage.parents == ["old@2"]
    assert changed.database("child").scenario_ids == [ONE, THREE, FOUR]


@pytest.mark.long
def test_rebase_can_keep_the_members(changed):
    (diff,) = changed.rebase("old", keep_members=True)
    assert (diff.ids("came"), diff.ids("went"), diff.ids("changed")) == ([], [TWO], [ONE])
    kept = changed.database("old")
    assert kept.lineage.operation == "rebase"
    assert kept.lineage.parents == ["old@1"]
    assert kept.scenario_ids == [ONE, THREE]
    assert changed.rebuild("old").is_same
    changed.rebase("child", keep_members=True)  # although its parent is now another version


def test_rebase_works_after_the_snapshot_is_removed(changed):
    changed.files.path("snapshots/00000001.json").unlink()
    with pytest.warns(StaleDatabaseWarning, match="columns cannot be compared, only members: .* no snapshot 1"):
        (diff,) = changed.rebase("old")
    assert diff.ids("came") == [FOUR]
    with pytest.raises(DatabaseNotFound, match="no database 'nothing'"):
        changed.rebase("nothing")


# --- diff ----------------------------------------------------------------------------------------------------


def test_databases_of_one_snapshot_differ_in_members(logs):
    logs.filter("num_objects > 1", name="a")
    logs.filter("num_objects < 4", name="b")
    diff = logs.diff("a", "b")
    a, b = (set(logs.database(name).scenario_ids) for name in "ab")
    assert set(diff.ids("came")) == b - a
    assert set(diff.ids("went")) == a - b
    assert (len(diff), diff.count("changed"), diff.columns) == (len(a ^ b), 0, ())
    assert logs.diff("a", logs.database("a")).is_same


def test_snapshots_differ_in_scenarios_and_columns(changed):
    last = changed.snapshot.number
    diff = changed.diff("@1", f"@{last}")
    assert (diff.ids("came"), diff.ids("went"), diff.ids("changed")) == ([FOUR], [TWO], [ONE])
    columns = {column.name: column for column in diff.columns}
    assert {"content_hash", "num_objects"} <= set(columns)
    assert not any(name.startswith(("tracks_", "lights_", "maps_")) for name in columns)
    found = columns["num_objects"]
    before, after = (changed.at_snapshot(k).describe(ONE)["num_objects"] for k in (1, last))
    assert (found.count, found.scenario_id, found.before, found.after) == (1, ONE, before, after)
    assert changed.diff("@1", "same").ids("went") == [ONE, TWO]
    assert changed.diff(f"@{last}", f"@{last}").is_same
    with pytest.raises(BadParameter, match="'@new': wanted a snapshot such as @7"):
        changed.diff("@new", "old")
    with pytest.raises(NoSuchSnapshot):
        changed.diff("@99", "old")


def test_empty_lake_differs_in_everything(changed):
    nothing = {"number": 0, "created_at": "", "operation": "", "metadata": [], "manifests": []}
    place = open_files(changed.root).place_to_write("snapshots/00000000.json")
    (changed.root / "snapshots" / "00000000.json").write_bytes(seals.seal_json(nothing, place))
    diff = changed.diff("@0", "@1")
    assert diff.counts == (0, 3)
    assert diff.count("came") == 3


# --- lineage -------------------------------------------------------------------------------------------------


def test_lineage_tree_names_every_parent(logs):
    logs.filter("num_objects > 1", name="a")
    logs.filter("num_objects > 2", name="a", replace=True)
    logs.filter("true", name="b")
    logs.merge("a@1", "a", "b", name="c")
    tree = logs.lineage("c")
    assert [parent.reference for parent in tree.parents] == ["a@1", "a@2", "b@1"]
    assert tree.parents[0].versions == (1, 2)
    assert tree.parents[0].children == ("c@1",)
    assert tree.parents[2].lineage.count == COUNT
    assert tree.lineage.operation == "merge"
    logs.drop("b", force=True)
    gone = logs.lineage("c").parents[2]
    assert (gone.reference, gone.lineage, gone.versions) == ("b@1", None, ())
