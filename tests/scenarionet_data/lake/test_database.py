"""Databases and unsaved selections as objects: members, scenarios, derived databases, use in worker processes."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarionet_data import Database, Lake, ScenarioLoader
from scenarionet_data.errors import BadParameter, DatabaseExists, DatabaseNotFound, EmptyResult
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from tests.fixtures.lakes import write_lake, write_shard
from tests.fixtures.scenarios import NUM_VARIED, make_scenario


def rows(database):
    return database.members.to_pylist()


def test_database_is_a_sequence_of_scenarios_and_contains_ids(own):
    busy = own.filter("num_objects > 3", name="busy")
    ids = busy.scenario_ids
    assert (len(busy), list(busy)) == (len(ids), ids)
    assert ids[0] in busy
    assert "made/v1/none" not in busy
    assert busy[0].id == ids[0]
    assert busy[-1].id == ids[-1]
    assert [scenario.id for scenario in busy[1:3]] == ids[1:3]
    assert [scenario.id for scenario in busy.loader()] == ids
    assert own.loader("busy").scenario_ids == ids
    with pytest.raises(IndexError):
        busy[len(busy)]
    assert busy.sql("SELECT count(*) AS n FROM metadata")["n"].item() == len(busy)
    assert repr(busy) == f"Database('busy@1', {len(busy)} scenarios, lake={str(own.root)!r})"


def test_database_creates_derived_databases(own):
    busy = own.database(own.filter("num_objects > 2", name="busy").reference)
    crowded = busy.filter("num_objects > 4", name="crowded")
    assert crowded.lineage.parents == ["busy@1"]
    assert {*crowded} < {*busy}
    parts = busy.split({"a": 0.5, "b": 0.5}, seed=1, by="source_log")
    assert sorted(parts["a"].scenario_ids + parts["b"].scenario_ids) == sorted(busy)
    assert len(busy.sample(n=2, name="two")) == 2
    assert {*busy.select("num_objects > 4")} == {*crowded}
    assert own.rebuild("crowded").is_same


def test_selection_is_a_database_without_a_name(own):
    selected = own.select("num_objects > 3", filters={"ego_distance": {"min": 0}})
    assert isinstance(selected, Database)
    assert (selected.name, selected.version, selected.is_saved, own.databases) == (None, None, False, [])
    assert [scenario.id for scenario in ScenarioLoader(own, selected)] == selected.scenario_ids
    assert selected[0].id == selected.scenario_ids[0]
    assert len(own.restrict_to(selected)) == len(selected)
    assert own.compare(selected)[0].count == len(selected)
    assert own.mine("cut_in", database=selected).is_empty()
    with pytest.raises(BadParameter, match=r"not saved: give it a name with selection.save\(name\)"):
        own.pack(selected, own.root / "pack")
    with pytest.raises(BadParameter, match="save it first"):
        own.merge(selected, selected, name="both")
    with pytest.raises(EmptyResult):
        own.select("false").save("none")
    assert len(own.select("false").save("none", allow_empty=True)) == 0


CONDITIONS = st.sampled_from(["true", "num_objects > 3", "num_objects < 4", "hash(scenario_id) % 2 = 0", "false"])


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(first=CONDITIONS, second=CONDITIONS, limit=st.integers(2, 5))
def test_saved_selection_equals_the_selection(own, first, second, limit):
    selected = own.select(first).select(f"({second}) AND num_objects <= $min", parameters={"min": limit})
    saved = selected.save("saved", replace=True, allow_empty=True)
    assert rows(own.database(saved.reference)) == rows(selected)
    assert len(saved) == len(selected)
    assert own.rebuild(saved).is_same
    filtered = own.filter(
        f"({first}) AND ({second}) AND num_objects <= {limit}", name="one", replace=True, allow_empty=True
    )
    assert filtered.scenario_ids == saved.scenario_ids


def test_parameters_of_nested_selections_do_not_collide(own):
    selected = own.select("num_objects > $n", parameters={"n": 2}, filters="ego_distance:min=0")
    nested = selected.select("num_objects < $n", parameters={"n": 5}, filters={"ego_distance": {"min": -1.0}})
    saved = nested.filter("true", name="middle")
    assert saved.scenario_ids == own.select("num_objects > 2 AND num_objects < 5").scenario_ids
    assert own.rebuild("middle").is_same
    sampled = nested.sample(n=1, seed=3, name="one")
    assert own.rebuild("one").is_same
    assert sampled.scenario_ids[0] in nested
    parts = nested.split({"a": 0.5, "b": 0.5}, name="half", by="source_log", allow_empty=True)
    assert sorted(parts["a"].scenario_ids + parts["b"].scenario_ids) == sorted(nested)
    assert own.rebuild("half_a").is_same
    with pytest.raises(BadParameter, match="give the parts one, with name="):
        nested.split({"a": 0.5, "b": 0.5})


def grow(root, number):
    """Add a scenario to a lake as another shard."""
    shard = write_shard(root, [make_scenario(100 + number, num_objects=9, num_steps=6, num_lanes=1)], f"more{number}")
    commits.commit(open_files(root), [shard], "grow")


@pytest.mark.integration
@pytest.mark.parametrize("is_saved", [True, False])
def test_pickled_database_is_unchanged_in_a_worker_after_the_lake_grew(own, is_saved):
    selected = own.select("num_objects >= 5")
    database = selected.save("many") if is_saved else selected
    assert database[0].id == database.scenario_ids[0]  # with an open loader and connection
    content = pickle.dumps(database)
    grow(own.root, 1)
    assert len(own.refresh().select("num_objects >= 5")) == len(database) + 1
    code = (
        "import pickle, sys\ndatabase = pickle.load(sys.stdin.buffer)\n"
        "print(*database, database[0].id, len(database.select()), database.view.snapshot.number)"
    )
    done = subprocess.run([sys.executable, "-c", code], input=content, capture_output=True, check=True)
    expected = [*database, database.scenario_ids[0], str(len(database)), "1"]
    assert done.stdout.decode().split() == expected
    assert pickle.loads(content).members.equals(database.members)


def test_selection_keeps_its_snapshot(own):
    selected = own.select("num_objects >= 5")
    before = selected.scenario_ids
    grow(own.root, 2)
    newest = Lake(own.root)
    assert [scenario.id for scenario in ScenarioLoader(newest, selected)] == before
    saved = newest.filter("true", name="kept", database=selected)
    assert (saved.scenario_ids, saved.lineage.snapshot) == (before, 1)
    assert newest.rebuild("kept").is_same


def test_selection_of_another_lake_is_refused(own, tmp_path):
    other = write_lake(tmp_path / "other", [make_scenario(1)])
    with pytest.raises(BadParameter, match=r"the selection is from .*other, not from"):
        ScenarioLoader(own, other.select())


def test_duplicate_names_are_refused(own):
    own.select().save("all")
    with pytest.raises(DatabaseExists, match="replace=True"):
        own.select().save("all")
    with pytest.raises(BadParameter, match="all@1 is saved already"):
        own.database("all").save("again")
    assert own.select().save("all", replace=True).reference == "all@2"


def test_conditions_in_three_forms(own):
    forms = ("ego_distance:min=0.5", ["ego_distance:min=0.5"], {"ego_distance": {"min": 0.5}})
    assert len({tuple(own.select(filters=form)) for form in forms}) == 1
    with pytest.raises(BadParameter, match="ego_distance has no parameter 'minimum'; it has min"):
        own.select(filters={"ego_distance": {"minimum": 1}})
    with pytest.raises(BadParameter, match="min wants float, found '1'"):
        own.select(filters={"ego_distance": {"min": "1"}})
    assert own.mine("hard_braking", {"ego_only": True}).is_empty()
    with pytest.raises(BadParameter, match="ego_only wants bool, found 1"):
        own.mine("hard_braking", {"ego_only": 1})
    assert len(own.select(events={"hard_braking": {"ego_only": True}})) == 0


def test_single_string_in_place_of_a_list_is_refused(own):
    own.select().save("busy")
    assert own.compare("busy")[0].count == NUM_VARIED
    for wrong in (lambda: own.merge("busy", name="m"), lambda: own.overlap("busy")):
        with pytest.raises(BadParameter, match="wanted two databases or more, found 1"):
            wrong()
    for wrong in (lambda: own.merge(["busy", "busy"], name="m"), lambda: own.compare(["busy"])):
        with pytest.raises(BadParameter, match="give databases one by one"):
            wrong()
    with pytest.raises(BadParameter, match="put it into a list"):
        own.select(ids="made/v1/s000001")
    with pytest.raises(DatabaseNotFound, match="no database 'b'"):
        own.loader("b")


def test_operations_accept_a_path(own):
    from scenarionet_data.packs.packing import pack
    from scenarionet_data.quality.checks import run_checks

    own.filter(name="all")
    assert all(result.is_met for result in run_checks(own.root, names=["ids_are_unique"]).results)
    assert pack(str(own.root), "all", own.root.parent / "pack").num_scenarios == NUM_VARIED
    assert len(ScenarioLoader(str(own.root), "all")) == NUM_VARIED


def test_selection_can_be_exported_and_plotted(own, tmp_path):
    selected = own.select("num_objects > 3")
    assert selected.export(tmp_path / "pickles").num_scenarios == len(selected)
    assert own.export(selected, tmp_path / "again").num_scenarios == len(selected)
    plots = pytest.importorskip("scenarionet_data.plots.distributions")
    groups = plots.distributions(own, "num_objects", databases=[selected])
    assert [group.counts.sum() for group in groups] == [len(selected)]


def test_verbs_of_lakes_and_databases_are_the_same_methods(own):
    for verb in ("filter", "select", "split", "sample"):
        assert getattr(Lake, verb) is getattr(Database, verb)
    parts = own.split({"train": 0.5, "val": 0.5}, by="source_log", name="half", allow_empty=True)
    again = own.select().split({"train": 0.5, "val": 0.5}, by="source_log", name="again", allow_empty=True)
    assert {part: list(each) for part, each in parts.items()} == {part: list(each) for part, each in again.items()}
    with pytest.raises(BadParameter, match="fractions are given twice"):
        own.split({"train": 1.0}, {"train": 1.0}, name="x")
    with pytest.raises(BadParameter, match=r"half_train@1 is the database already: lake.filter"):
        parts["train"].filter(database="half_val", name="x")


def test_parts_and_handles_describe_themselves_in_a_line(own):
    scenario = own.select()[0]
    steps = scenario.num_timesteps
    assert repr(scenario.tracks) == f"Tracks({len(scenario.tracks)} objects, {steps} timesteps)"
    assert repr(scenario.lights) == f"Lights({len(scenario.lights)} lights, {steps} timesteps)"
    lanes = int((scenario.map.feature_type == MapFeatureType.LANE_SURFACE_STREET).sum())
    assert repr(scenario.map).startswith(f"MapFeatures({len(scenario.map):,} features, {lanes:,} LANE_SURFACE_STREET")
    for shown, words in ((scenario, scenario.id), (own, str(own.root)), (own.select(), "unsaved selection")):
        assert words in shown._repr_html_()
