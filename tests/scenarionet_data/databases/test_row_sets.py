"""Databases of large lakes are stored as rows of metadata files: the same members, in the same order, as by ids."""

from __future__ import annotations

import pickle
import shutil
import warnings
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.maintenance.compaction import compact
from scenarionet_data.maintenance.fsck import fsck, repair
from scenarionet_data.maintenance.vacuuming import vacuum
from scenarionet_data.operations.split import LeakWarning
from scenarionet_data.packs.packing import pack
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.snapshots import commit, snapshot
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed

SMALL = {"num_steps": 5, "num_lanes": 0, "num_lights": 0, "has_map": False}
FEW = 1 << 60


def scenario(number):
    """Scenario ``number``, of one of five logs; ids are not in the order of shards."""
    made = renamed(make_scenario(number, num_objects=1 + number % 7, **SMALL), f"s{number * 37 % 100:02d}")
    return replace(made, source=replace(made.source, log=f"log{number % 5}"))


@pytest.fixture(scope="module")
def _written(tmp_path_factory):
    root = tmp_path_factory.mktemp("rows") / "lake"
    for number, name in enumerate("cab"):
        write_lake(root, [scenario(k) for k in range(8 * number, 8 * number + 8)], name)
    return root


@pytest.fixture
def large(_written, tmp_path, monkeypatch):
    """A lake of 24 scenarios in three shards that counts as large."""
    monkeypatch.setattr(snapshot, "MANY", 0)
    return Lake(shutil.copytree(_written, tmp_path / "large"))


FILTERS = {"few": "num_objects > 5", "all": "true", "half": "num_objects % 2 = 0"}

MADE = {
    "filter of a database": lambda lake: lake.filter("num_objects < 5", name="new", database="half"),
    "filter of a merged one": lambda lake: lake.filter("num_objects > 1", name="new", database=both(lake)),
    "filter with a subquery": lambda lake: lake.filter(
        "num_objects > (SELECT avg(num_objects) FROM metadata)", name="new", database="half"
    ),
    "filter by ids": lambda lake: lake.filter(ids=lake.database("half").scenario_ids[:2], name="new"),
    "ordered filter": lambda lake: lake.filter(name="new", order_by="num_objects DESC"),
    "ordered filter of a database": lambda lake: lake.filter(name="new", database=both(lake), order_by="num_objects"),
    "limit": lambda lake: lake.filter(name="new", database=both(lake), limit=5),
    "selection": lambda lake: lake.select("num_objects > 3").select("num_objects < 6").save("new"),
    "merge": lambda lake: lake.merge("half", "few", "all", name="new"),
    "merge of a merged one": lambda lake: lake.merge(both(lake), "half", name="new"),
    "intersect": lambda lake: lake.intersect("half", "few", "all", name="new"),
    "subtract": lambda lake: lake.subtract("all", "half", "few", name="new"),
    "copy": lambda lake: lake.copy(both(lake), name="new"),
    "sample": lambda lake: lake.sample(both(lake), name="new", n=7, seed=3),
    "stratified sample": lambda lake: lake.sample("all", name="new", fraction=0.5, stratify="source_log"),
    "levels of a sample": lambda lake: lake.sample(both(lake), name="new", n=6, levels=3),
    "part by ids": lambda lake: lake.split("all", {"a": 0.5, "b": 0.5})["b"],
    "part of the lake": lambda lake: lake.split({"a": 0.3, "b": 0.7}, seed=4)["b"],
    "part by logs": lambda lake: lake.split(both(lake), {"a": 0.5, "b": 0.5}, by="source_log", name="x")["a"],
    "part of strata": lambda lake: lake.split("half", {"a": 0.5, "b": 0.5}, stratify="source_log")["b"],
    "part along a column": lambda lake: lake.split("all", {"a": 0.5, "b": 0.5}, along="num_objects")["a"],
    "level": lambda lake: lake.split("half", levels=3, along="num_objects")["level2"],
    "value": lambda lake: lake.split("all", each="source_log")["log3"],
    "old version": lambda lake: [lake.filter(name="few", replace=True), lake.checkout("few@1")][1],
}
QUICK = {"filter of a merged one", "merge", "subtract", "part by ids", "levels of a sample"}
OF_THEIR_OWN_ORDER = {"ordered filter", "ordered filter of a database", "limit", "levels of a sample"}


def both(lake):
    """A database of two sets: few, then half without them."""
    if "both" not in lake.databases:
        lake.merge("few", "half", name="both")
    return "both"


def fill(lake):
    for name, where in FILTERS.items():
        lake.filter(where, name=name)
    return lake


@pytest.mark.filterwarnings("ignore:this split leaks")
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.integration) for name in MADE]
)
def test_members_are_those_of_a_database_of_ids(name, large, tmp_path, monkeypatch):
    by_rows = MADE[name](fill(large))
    monkeypatch.setattr(snapshot, "MANY", FEW)
    by_ids = MADE[name](fill(Lake(shutil.copytree(large.root, tmp_path / "same", ignore=lambda *_: ["databases"]))))
    assert by_ids.rows is None
    assert (by_rows.rows is None) == (name in OF_THEIR_OWN_ORDER)
    assert by_rows.members.equals(by_ids.members)
    assert len(by_rows) == len(by_ids) == by_rows.members.num_rows > 0
    assert [each.id for each in by_rows.loader()] == by_ids.scenario_ids
    saved = Lake(large.root).database(by_rows.name)  # read with the lake counting as small
    assert saved.members.equals(by_ids.members)
    assert Lake(large.root).rebuild(saved).is_same


@pytest.mark.integration
def test_difference_and_overlap_are_the_same(large, monkeypatch):
    fill(large)
    found = large.diff("few", "half").rows, large.overlap("few", "half"), large.restrict_to("few").sql("FROM objects")
    monkeypatch.setattr(snapshot, "MANY", FEW)
    lake = Lake(large.root)
    again = lake.diff("few", "half").rows, lake.overlap("few", "half"), lake.restrict_to("few").sql("FROM objects")
    assert found[0].equals(again[0])
    assert found[1] == again[1]
    assert found[2].sort("scenario_id", "track_id").equals(again[2].sort("scenario_id", "track_id"))


def test_leaks_are_counted_alike(large, monkeypatch):
    texts = []
    for many in (0, FEW):
        monkeypatch.setattr(snapshot, "MANY", many)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", LeakWarning)
            Lake(large.root).split({"a": 0.5, "b": 0.5}, replace=True)
        texts += [str(each.message) for each in caught]
    assert len(texts) == 2
    assert texts[0] == texts[1]
    assert "5 source logs with 24 scenarios" in texts[0]


def test_bits_are_written_as_the_schema_says():
    sets = RowSets(("m/a", "m/b"), np.array([0, 3, 13]), (np.arange(13) % 3 == 0, np.arange(13) == 4))
    table = sets.to_table()
    assert table["bits"].to_pylist() == [b"\x01", b"\x49\x02", b"\x00", b"\x02\x00"]
    assert table["num_rows"].to_pylist() == [3, 10, 3, 10]
    assert table["set"].to_pylist() == [0, 0, 1, 1]
    again = RowSets.of_table(table)
    assert (again.metadata, again.starts.tolist(), len(again)) == (sets.metadata, [0, 3, 13], 6)
    assert all(np.array_equal(*pair) for pair in zip(again.sets, sets.sets, strict=True))


def test_members_stay_when_the_lake_grows_and_when_its_files_are_written_again(large):
    fill(large)
    wanted = large.merge("half", "few", name="both").members
    write_lake(large.root, [scenario(k) for k in range(30, 40)], "d")
    grown = Lake(large.root)
    assert grown.database("both").rows.among(grown.rows) is not None
    assert [each.id for each in ScenarioLoader(grown, "both")] == wanted["scenario_id"].to_pylist()
    assert len(grown.filter(name="every")) == 34
    assert set(grown.subtract("every", "both", name="rest")).isdisjoint(wanted["scenario_id"].to_pylist())
    compact(large.root, "analytics")
    compacted = Lake(large.root)
    assert compacted.database("both").rows.among(compacted.rows) is None
    assert [each.id for each in ScenarioLoader(compacted, "both")] == wanted["scenario_id"].to_pylist()
    vacuum(large.root, keep_last=1, older_than=0)
    assert compacted.database("both").members.equals(wanted)
    assert fsck(large.root, is_deep=True).is_whole
    moved = compacted.rebase("both", keep_members=True)
    assert [each.is_same for each in moved] == [True]
    assert Lake(large.root).database("both").members.equals(wanted)


def test_order_of_ids_is_stored_once(large):
    every = sorted(scenario(k).id for k in range(24))
    assert list(large.root.glob("snapshots/order-*")) == []
    assert ScenarioLoader(large).scenario_ids == every
    commit.consolidate(large.files)
    (stored,) = large.root.glob("snapshots/order-*")
    changed = stored.stat().st_mtime_ns
    assert ScenarioLoader(large).scenario_ids == [each.id for each in ScenarioLoader(large)] == every
    commit.consolidate(large.files)
    assert stored.stat().st_mtime_ns == changed
    found = fsck(large.root)
    assert (found.problems, found.notes) == ((), ())
    vacuum(large.root, keep_last=1, older_than=0)
    assert stored.exists()
    stored.write_bytes(stored.read_bytes()[:-1] + b"x")
    (problem,) = fsck(large.root).problems
    assert problem.file == f"snapshots/{stored.name}"
    assert "--repair" in problem.remedy
    assert repair(large.root, fsck(large.root)) == []
    assert fsck(large.root).is_whole
    assert stored.exists()


def test_rows_of_other_files_are_found(large):
    place = large.files.place_to_write(fill(large).database("half").file)
    file = large.root / place.name
    table, footer = pq.read_table(file), pq.read_metadata(file).metadata
    column = table.column_names.index("num_rows")
    wrong = table.set_column(column, "num_rows", [[9, *table["num_rows"].to_pylist()[1:]]])
    with pq.ParquetWriter(file, wrong.schema.with_metadata(footer)) as written:
        written.write_table(wrong)
    seals.seal(file, place)
    (problem,) = fsck(large.root).problems
    assert problem.file == "databases/half/1.parquet"
    assert "other numbers of rows" in problem.reason


def test_packs_hold_ids(large, tmp_path):
    fill(large)
    pack(large, "few", tmp_path / "pack")
    assert verify_pack(tmp_path / "pack").is_whole
    packed = Lake(tmp_path / "pack").database("few")
    assert packed.rows is None
    assert packed.members.equals(large.database("few").members)
    assert packed.lineage == large.database("few").lineage


def test_database_goes_to_other_processes_without_its_rows(large):
    database = fill(large).database("half")
    assert database.rows is not None
    sent = pickle.dumps(database)
    assert b"metadata/" not in sent.split(b"snapshot")[0]
    assert pickle.loads(sent).scenario_ids == database.scenario_ids
    selection = large.select("num_objects > 3")
    assert pickle.loads(pickle.dumps(selection)).scenario_ids == selection.scenario_ids


def test_databases_made_while_the_lake_was_small_stay_as_they_are(large, monkeypatch):
    monkeypatch.setattr(snapshot, "MANY", FEW)
    before = Lake(large.root).filter(FILTERS["half"], name="old")
    monkeypatch.setattr(snapshot, "MANY", 0)
    lake = fill(Lake(large.root))
    old = lake.database("old")
    assert old.rows is None
    assert lake.database("half").rows is not None
    assert old.members.equals(before.members)
    assert lake.diff("old", "half").is_same
    assert [each.id for each in old.loader()] == old.scenario_ids
    merged = lake.merge("few", "old", name="new")
    assert merged.rows is None
    assert merged.scenario_ids == lake.database(both(lake)).scenario_ids
    assert lake.filter("num_objects > 3", name="new", database="old", replace=True).scenario_ids == [
        each for each in old.scenario_ids if each in {*lake.select("num_objects > 3")}
    ]
