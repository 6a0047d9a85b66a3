"""Kept moments as scenarios: windows, egos by role, order, and what cannot be cut out."""

from __future__ import annotations

import shutil
import warnings

import numpy as np
import pytest

from scenarionet_data import Lake, Samples, Targets, TimeWindow
from scenarionet_data.errors import BadParameter, DatabaseExists, EmptyResult, QueryError
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.operations.moments import event, relation, selected
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.variations import MomentChoice, cut_moments
from scenarionet_data.variations.moment_windows import PartialMomentsWarning
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import content, write_lake, write_shard

pytestmark = pytest.mark.integration

SHORT = Other(40.0, vx=5.0, first=4, last=25)
DRIVES = [make_drive(f"d{k}", others=(Other(20.6 + 2 * k, vx=2.0), SHORT)) for k in range(3)]
CLOSING = {"closing": event("time_to_collision", {"max": 1.5}), "alone": relation("has_velocity")}

INSTANT = """
    SELECT scenario_id, track_id, 7 AS first_timestep, 7 AS last_timestep FROM objects WHERE track_id = 't1'
"""


@pytest.fixture(scope="module")
def _lake(tmp_path_factory) -> Lake:
    made = write_lake(tmp_path_factory.mktemp("moments") / "lake", DRIVES)
    made.keep_moments("near", CLOSING)
    return made


@pytest.fixture
def lake(_lake, tmp_path) -> Lake:
    return Lake(shutil.copytree(_lake.root, tmp_path / "lake"))


def kept(lake, definition="closing"):
    sql = "SELECT * FROM moments WHERE definition = $definition ORDER BY scenario_id"
    return lake.sql(sql, {"definition": definition}).rows(named=True)


def test_each_moment_is_a_scenario_with_its_window_and_its_actor_as_ego(lake):
    choice = MomentChoice("definition = 'closing'", ego="other", margin=0.5)
    made = cut_moments(lake, "near", choice, name="cuts")
    wanted = kept(lake)
    assert made.wanted == len(made.database) == made.report.converted == len(wanted) == 3
    for row, scenario in zip(wanted, lake.refresh().loader("cuts"), strict=True):
        parent = lake.loader([row["scenario_id"]])[0]
        first = max(row["first_timestep"] - 5, 0)
        assert scenario.current_timestep == row["first_timestep"] - first and scenario.timestamps[0] == 0
        assert scenario.num_timesteps == min(row["last_timestep"] + 6, 41) - first
        assert scenario.ego_id == row["other_id"] and scenario.extras["value"] == row["value"]
        ego, same = scenario.ego_index, parent.tracks.index(row["other_id"])
        window = slice(first, first + scenario.num_timesteps)
        assert np.array_equal(scenario.tracks.position[ego], parent.tracks.position[same, window])
    facts = lake.refresh().database("cuts").sql("SELECT DISTINCT moment, parent FROM metadata ORDER BY parent").rows()
    assert facts == [("closing", row["scenario_id"]) for row in wanted]


def test_order_and_limit_choose_and_the_lineage_makes_them_again(lake):
    choice = MomentChoice("definition = 'closing'", order_by="begins DESC", limit=2)
    cut_moments(lake, "near", choice, name="latest")
    found = lake.refresh()
    parents = [found.describe(each)["parent"] for each in found.database("latest")]
    assert parents == [row["scenario_id"] for row in sorted(kept(lake), key=lambda row: -row["begins"])][:2]
    assert found.rebuild("latest").is_same
    again = cut_moments(found, "near", choice, name="latest", replace=True)
    assert again.report.converted == 0 and again.database.scenario_ids == found.database("latest").scenario_ids
    lake.files.remove("moments/near/closing")
    assert not lake.refresh().rebuild("latest").is_same


def test_the_same_moments_in_another_lake_have_the_same_content(lake, tmp_path):
    other = write_lake(tmp_path / "other", DRIVES)
    other.keep_moments("near", CLOSING)
    for each in (lake, other):
        cut_moments(each, "near", name="all")
    made = [each.refresh().database("all").members.drop_columns(["weight"]).to_pylist() for each in (lake, other)]
    assert made[0] == made[1] and content(lake.root) == content(other.root)


def test_packs_and_samples_have_the_window(lake, tmp_path):
    cut_moments(lake, "near", MomentChoice("definition = 'closing'", ego="actor", margin=0.3), name="cuts")
    packed = Lake(lake.refresh().pack("cuts", tmp_path / "pack").path)
    for of_lake, of_pack in zip(lake.refresh().loader("cuts"), packed.loader("cuts"), strict=True):
        assert of_lake.extras == of_pack.extras and np.array_equal(of_lake.timestamps, of_pack.timestamps)
    samples = Samples(lake.refresh(), "cuts", window=TimeWindow(history=0.2, future=0.3), targets=Targets("ego"))
    found = [samples.key(k) for k in range(len(samples))]
    egos = {each.id: (each.current_timestep, each.ego_id) for each in lake.refresh().loader("cuts")}
    assert {each.scenario_id: (each.timestep, *each.track_ids) for each in found} == egos


def test_packs_have_the_kept_moments_of_their_members(lake, tmp_path):
    lake.keep_moments("other", {"turns": relation("turning")})
    lake.filter("ends_with(scenario_id, 'd1')", name="one")
    packed = Lake(lake.pack("one", tmp_path / "pack").path)
    moments = "SELECT * FROM moments WHERE ends_with(scenario_id, 'd1') ORDER BY ALL"
    assert packed.sql(moments).equals(lake.sql(moments)) and len(packed.sql("FROM moments")) > 1
    assert packed.sql("SELECT DISTINCT definition FROM moments_rows ORDER BY 1")["definition"].to_list() == [
        "alone", "closing", "turns",
    ]  # fmt: skip
    assert [(each.definition, each.scenarios) for each in packed.keep_moments("near")] == [("alone", 0), ("closing", 0)]
    assert verify_pack(packed.root).is_whole and fsck(packed.root, is_deep=True).is_whole


def test_an_ego_that_comes_late_or_leaves_shortens_the_margin_but_not_the_moment(lake):
    cut_moments(lake, "near", MomentChoice("definition = 'alone' AND track_id = 't2'", ego="actor"), name="short")
    for scenario in lake.refresh().loader("short"):
        assert scenario.current_timestep == 0 and scenario.num_timesteps == 41 - 4
        assert scenario.tracks.valid[scenario.ego_index].sum() == 22


def test_what_cannot_be_cut_out_is_counted_with_its_reason(lake):
    made = cut_moments(lake, "near", MomentChoice(ego="other"), name="some")
    assert made.wanted - len(made.database) == made.report.quarantined > 0
    (reason,) = lake.refresh().sql("SELECT DISTINCT message FROM quarantine").row(0)
    assert "nobody is the other of alone" in reason


def test_a_moment_of_one_timestep_wants_a_margin(lake):
    lake.keep_moments("instants", {"now": selected(INSTANT)})
    with pytest.raises(EmptyResult, match="none of 3 moments can be cut out"):
        cut_moments(lake, "instants", MomentChoice(margin=0.0), name="instants")
    reasons = lake.refresh().sql("SELECT DISTINCT message FROM quarantine")["message"].to_list()
    assert len(reasons) == 1 and "now lasts for one timestep, 7; keep time around it" in reasons[0]
    assert len(cut_moments(lake, "instants", MomentChoice(margin=0.2), name="instants").database) == 3


def test_moments_that_do_not_cover_the_lake_are_named(lake):
    commits.commit(lake.files, [write_shard(lake.root, [make_drive("new")], "b")], "test")
    with pytest.warns(PartialMomentsWarning, match="of 4 scenarios were mined alone over 3, closing over 3"):
        cut_moments(lake.refresh(), "near", name="part")
    lake.refresh().keep_moments("near", CLOSING)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cut_moments(lake.refresh(), "near", name="whole")


@pytest.mark.parametrize(
    ("choice", "error", "message"),
    [
        ({"where": "vallue < 2"}, QueryError, "no column vallue at character 1"),
        ({"where": "value < -1"}, EmptyResult, "none of the moments kept as 'near' satisfies"),
        ({"ego": "victim"}, BadParameter, "ego='victim': wanted one of ego, actor, other"),
        ({"margin": -1.0}, BadParameter, "wanted seconds"),
        ({"limit": 0}, BadParameter, "whole number of 1 or more"),
    ],
)
def test_bad_choices_are_sentences(lake, choice, error, message):
    with pytest.raises(error, match=message):
        cut_moments(lake, "near", MomentChoice(**choice), name="bad")


def test_names_are_checked_first(lake):
    with pytest.raises(BadParameter, match=r"no moments are kept under this name.*there are: near"):
        cut_moments(lake, "far", name="cuts")
    cut_moments(lake, "near", name="cuts")
    with pytest.raises(DatabaseExists):
        cut_moments(lake, "near", name="cuts")
