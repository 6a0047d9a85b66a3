"""Kept moments: each definition is mined once over each scenario, whatever changes in between; files are guarded."""

from __future__ import annotations

import os
import shutil
import time
import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_data.building import cut_steps
from scenarionet_data.errors import BadParameter, LakeError, QueryError
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.maintenance.vacuuming import plan_vacuum, vacuum
from scenarionet_data.operations import mining
from scenarionet_data.operations.cautions import MissedMomentsWarning
from scenarionet_data.operations.compiled_relations import CompiledRelations
from scenarionet_data.operations.mining import Mined
from scenarionet_data.operations.moments import event, relation, selected
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.storage import kept_moments
from scenarionet_data.storage.snapshots import commit as commits
from tests.fixtures.lakes import write_lake, write_shard
from tests.fixtures.moments import STEPS, along, moment, walking

STANDING = along(0, 0)
SCENARIOS = [
    moment("passing", STANDING, who=walking(-10, 5, 2)),
    moment("alone", STANDING),
    moment("braking", along(0, 0, 10), car=along(20, 0, 10)),
]
NEW = moment("new", STANDING, who=walking(-10, 5, 2), she=walking(-10, 6, 2))
NEAR, FAST = relation("near_objects", {"distance_thresh": 5.0}), relation("has_velocity", {"min_velocity": 5.0})


@pytest.fixture(scope="module")
def _lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("mined") / "lake", SCENARIOS).root


@pytest.fixture
def lake(_lake, tmp_path):
    return Lake(shutil.copytree(_lake, tmp_path / "lake"))


def add(lake, *scenarios, name="b"):
    commits.commit(lake.files, [write_shard(lake.root, scenarios, name)], "test")
    return lake.refresh()


def moments(lake, columns="definition, scenario_id, track_id, other_id, first_timestep, last_timestep"):
    return sorted(lake.sql(f"SELECT {columns} FROM moments").rows(), key=repr)


def test_kept_moments_are_those_that_are_found(lake):
    mined = lake.keep_moments("all", {"near": NEAR, "fast": FAST, "gap": event("closest_approach", {"max": 30.0})})
    assert mined == [Mined("near", 1, 3, 2), Mined("fast", 1, 3, 2), Mined("gap", 1, 3, 2)]
    found = lake.moments(NEAR)
    kept = lake.sql(
        "SELECT scenario_id, track_id, other_id, first_timestep, last_timestep, begins, ends FROM moments "
        "WHERE definition = 'near' ORDER BY ALL"
    )
    assert kept.rows() == sorted(found.select(kept.columns).rows())
    assert lake.sql("SELECT DISTINCT ego_id, name FROM moments").rows() == [("ego", "all")]
    values = lake.mine("closest_approach", {"max": 30.0})["value"].to_list()
    assert [value for (value,) in moments(lake, "value") if value is not None] == sorted(values, key=repr)
    nothing = "SELECT scenario_id FROM moments_rows WHERE first_timestep IS NULL AND definition = 'near' ORDER BY ALL"
    assert [name.rpartition("/")[2] for (name,) in lake.sql(nothing).rows()] == ["alone", "braking"]


def test_a_name_of_both_is_the_event():
    assert mining.defined("following", {}).moments == event("following")
    assert mining.defined("stationary", {}).moments == relation("stationary").lasting()


def test_new_scenarios_are_mined_alone(lake, monkeypatch):
    lake.keep_moments("all", {"near": NEAR, "fast": FAST})
    before = moments(lake)
    read, restrict_to = [], Lake.restrict_to
    monkeypatch.setattr(Lake, "restrict_to", lambda self, ids: read.append(ids) or restrict_to(self, ids))
    assert lake.keep_moments("all") == [Mined("fast", 1, 0, 0), Mined("near", 1, 0, 0)]
    assert read == []
    lake = add(lake, NEW)
    assert lake.keep_moments("all") == [Mined("fast", 1, 1, 0), Mined("near", 1, 1, 6)]
    assert read == [[NEW.id]]
    assert [row for row in moments(lake) if row[1] != NEW.id] == before
    assert len(moments(lake)) == len(before) + 6


def test_a_changed_definition_is_mined_alone(lake):
    lake.keep_moments("all", {"near": NEAR, "fast": FAST})
    near = relation("near_objects", {"distance_thresh": 4.5})
    mined = lake.keep_moments("all", {"near": near, "fast": FAST})
    assert mined == [Mined("near", 2, 3, 2), Mined("fast", 1, 0, 0)]
    spans = lake.moments(near).select("scenario_id", "track_id", "other_id", "first_timestep", "last_timestep")
    assert [row[1:] for row in moments(lake) if row[0] == "near"] == sorted(spans.rows())
    assert lake.keep_moments("all", {"near": NEAR})[0] == Mined("near", 3, 3, 2)


def test_a_changed_view_is_another_definition(lake, monkeypatch):
    first = mining.Defined(NEAR.lasting()).description()["sha256"]
    assert first == mining.Defined(NEAR.lasting()).description()["sha256"]
    texts = mining.dependencies(NEAR.sql)
    assert "CREATE VIEW smoothed" in texts and "CREATE MACRO wrap_angle" in texts
    monkeypatch.setattr(mining, "dependencies", lambda sql: texts.replace("0.0", "0.1"))
    assert first != mining.Defined(NEAR.lasting()).description()["sha256"]


def test_replaced_scenarios_lose_their_moments_and_are_mined_again(lake):
    lake.keep_moments("all", {"near": NEAR})
    changed = moment("passing", STANDING, who=walking(-20, 50, 2))
    lake = add(lake, changed, *SCENARIOS[1:], name="a")
    assert moments(lake) == []
    assert lake.keep_moments("all") == [Mined("near", 1, 1, 0)]


def test_members_alone_are_mined(lake):
    lake.filter("ends_with(scenario_id, 'braking')", name="some")
    assert lake.keep_moments("all", {"fast": FAST}, "some") == [Mined("fast", 1, 1, 2)]
    assert lake.keep_moments("all", {"fast": FAST}) == [Mined("fast", 1, 2, 0)]


def test_batches_and_one_pass_give_the_same(lake, monkeypatch):
    whole = lake.moments(NEAR).rows()
    lake.keep_moments("all", {"near": NEAR})
    monkeypatch.setattr(mining, "MAX_STATES", 100)
    assert lake.moments(NEAR).rows() == whole
    steps = []
    lake.keep_moments("parts", {"near": NEAR}, on_progress=lambda *done: steps.append(done))
    assert len(steps) > 1 and steps[-1] == (3, 3, 0)
    spans = "SELECT * EXCLUDE (name) FROM moments WHERE name = ? ORDER BY ALL".replace("?", "$name")
    assert lake.sql(spans, {"name": "all"}).rows() == lake.sql(spans, {"name": "parts"}).rows()


def test_two_jobs_do_not_publish_a_scenario_twice(lake):
    first = kept_moments.claim(lake.files, "all", "near", mining.Defined(NEAR.lasting()).description())
    second = kept_moments.claim(lake.files, "all", "near", mining.Defined(NEAR.lasting()).description())
    wanted = lake.arrow("SELECT scenario_id, content_hash FROM metadata_rows")
    rows = mining._find(CompiledRelations(lake), first, mining.Defined(NEAR.lasting()), wanted)
    assert (first.version, second.version) == (1, 1)
    assert first.publish(rows) == 2
    assert second.publish(rows) == 0
    assert len(moments(lake)) == 2


def test_an_interrupted_job_keeps_what_it_has(lake, monkeypatch):
    monkeypatch.setattr(mining, "MAX_STATES", 100)

    def stop(*done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lake.keep_moments("all", {"near": NEAR}, on_progress=stop)
    (left,) = lake.keep_moments("all", {"near": NEAR})
    assert left.scenarios == 2
    assert lake.sql("SELECT count(DISTINCT scenario_id), count(*) FROM moments_rows").row(0) == (3, 4)


def test_fsck_finds_damaged_moments(lake):
    lake.keep_moments("all", {"near": NEAR})
    assert fsck(lake.root, is_deep=True).is_whole
    (part,) = lake.paths("moments")
    with Path(part).open("r+b") as file:
        file.seek(40)
        file.write(b"xxxx")
    (problem,) = fsck(lake.root, is_deep=True).problems
    assert problem.file == "moments/all/near/1/moments/000001.parquet"
    with pytest.raises(LakeError, match=r"000001\.parquet"):
        Lake(lake.root).sql("SELECT * FROM moments")
    description = lake.files.path("moments/all/near/1/run.json")
    description.write_text(description.read_text().replace("near_objects", "far_objects").replace("5.0", "6.0"))
    assert {each.file for each in fsck(lake.root).problems} == {"moments/all/near/1/run.json"}


def test_parts_of_a_dropped_definition_are_not_taken_for_new_ones(lake, tmp_path):
    lake.keep_moments("all", {"near": NEAR})
    part = lake.paths("moments")[0]
    kept = shutil.copy(part, tmp_path)
    shutil.rmtree(lake.files.path("moments"))
    lake.keep_moments("all", {"near": NEAR}, lake.filter("false", name="none", allow_empty=True))
    Path(part).parent.mkdir(parents=True)
    shutil.copy(kept, part)
    with pytest.raises(LakeError, match=r"differs from the one that was written under this name"):
        Lake(lake.root).sql("SELECT * FROM moments")


def test_vacuum_removes_what_a_newer_definition_has_replaced(lake):
    lake.keep_moments("all", {"near": NEAR, "fast": FAST})
    lake.keep_moments("all", {"near": relation("near_objects", {"distance_thresh": 4.5})})
    before = moments(lake)
    old = [f"moments/all/near/1/{name}" for name in ("moments/000001.parquet", "run.json")]
    assert [each.name for each in plan_vacuum(lake.root, keep_last=1).young] == old
    assert vacuum(lake.root, keep_last=1).files == ()
    yesterday = time.time() - 90_000
    for file in old:
        os.utime(lake.files.path(file), (yesterday, yesterday))
    assert [each.name for each in vacuum(lake.root, keep_last=1).files] == old
    assert fsck(lake.root).is_whole
    assert moments(Lake(lake.root)) == before


@pytest.mark.parametrize(("name", "definition"), [("a/b", "near"), ("all", "../near"), ("", "near")])
def test_names_that_are_none_are_refused(lake, name, definition):
    with pytest.raises(BadParameter, match=r"is no name of moments"):
        lake.keep_moments(name, {definition: NEAR})


def test_unknown_names_are_refused(lake):
    with pytest.raises(BadParameter, match=r"no moments are kept under the name 'some'; there are: none yet"):
        lake.keep_moments("some")


BAD_SQL = {
    "5 AS first_timestep, 3 AS last_timestep": "timesteps 5 to 3: a moment does not end before it begins",
    "5 AS first_timestep, 101 AS last_timestep": "timesteps 5 to 101: there are 0 to 100",
    "-1 AS first_timestep, 3 AS last_timestep": "timesteps -1 to 3: there are 0 to 100",
    "5 AS first_timestep, NULL::INTEGER AS last_timestep": "a moment has a first and a last one",
    "5 AS first_timestep, 7 AS last_timestep, 'nobody' AS other_id": "there is no track nobody",
}


@pytest.mark.parametrize("columns", BAD_SQL)
def test_windows_and_roles_that_cannot_be_are_refused(lake, columns):
    found = selected(f"SELECT scenario_id, track_id, {columns} FROM objects")
    with pytest.raises(QueryError, match=BAD_SQL[columns]):
        lake.moments(found)
    with pytest.raises(QueryError, match=BAD_SQL[columns]):
        lake.keep_moments("all", {"bad": found})


def test_a_window_of_one_timestep_and_nobody_in_a_role_are_moments(lake):
    columns = "track_id, NULL::VARCHAR AS other_id, 100 AS first_timestep, 100 AS last_timestep"
    assert len(lake.moments(selected(f"SELECT scenario_id, {columns} FROM objects"))) == 5


def test_gaps_and_ends_of_an_actor_end_its_moments(tmp_path):
    gone, ends = [*range(30), *range(50, STEPS)], slice(0, 40)
    made = [
        moment(name, STANDING, who=along(3, 0, kind=ObjectType.PEDESTRIAN, seen=seen))
        for name, seen in (("gap", gone), ("end", ends))
    ]
    found = write_lake(tmp_path / "lake", made).moments(NEAR.lasting(0.5))
    spans = found.select("scenario_id", "track_id", "first_timestep", "last_timestep").rows()
    assert sorted((name.rpartition("/")[2], *span) for name, track, *span in spans if track == "who") == [
        ("end", 0, 39), ("gap", 0, 29), ("gap", 50, 100),
    ]  # fmt: skip


def test_long_timesteps_are_told(lake, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lake.moments(FAST)
    every = slice(None, None, 5)
    coarse = [replace(cut_steps(each, every), dt=0.5) for each in SCENARIOS[:1]]
    slow = write_lake(tmp_path / "slow", [*coarse, *SCENARIOS[1:]])
    said = r"1 of 3 scenarios have timesteps of up to 0\.5 s; .*shorter than 2 s are missed"
    with pytest.warns(MissedMomentsWarning, match=said):
        slow.moments(FAST)
    with pytest.warns(MissedMomentsWarning, match=said):
        slow.keep_moments("all", {"fast": FAST})
    with warnings.catch_warnings():  # events do not smooth
        warnings.simplefilter("error")
        slow.moments(event("closest_approach"))


def test_a_category_that_no_object_has_is_told(lake):
    with pytest.warns(MissedMomentsWarning, match=r"no object is of category 'ELEPHANT'; there are ANY, .*VEHICLE"):
        lake.moments(relation("is_category", {"category": "elephant"}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lake.moments(relation("is_category", {"category": "pedestrian"}))
