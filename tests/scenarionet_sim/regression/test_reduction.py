"""The smallest scenario of a failure: by a predicate, and by driving."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim import RegressionPlan, drive_again, regress
from scenarionet_sim.evaluation.evaluation import plan_evaluation
from scenarionet_sim.regression.reduction import (
    DriveOnce,
    Reduction,
    ReductionJob,
    fewest,
    reduce_failure,
    smallest_passing,
)
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.integration

CROWD = tuple(Other(20.0 + 6.0 * k, y=3.5, vx=9.0) for k in range(6))
STOPPED = Other(60.0)


@pytest.mark.parametrize("needed", [set(), {5}, {0, 7}, {1, 2, 11}, set(range(12))])
def test_fewest_keeps_what_is_needed(needed):
    tried = []

    def fails(items):
        tried.append(tuple(items))
        return needed <= set(items)

    assert set(fewest(range(12), fails)) == needed
    assert len(tried) <= 12**2 + 3 * 12, "the bound of Zeller and Hildebrandt"


def test_what_fails_only_in_pairs_keeps_a_pair():
    def fails(items):
        return len(set(items) & {1, 5, 9}) >= 2

    assert len(fewest(range(12), fails)) == 2


@pytest.fixture
def crowded(tmp_path):
    """A car that stands on the ego's lane among six that drive beside it; and the same without it."""
    drives = [
        make_drive("crash", speed=10.0, num_steps=91, others=(*CROWD[:3], STOPPED, *CROWD[3:])),
        make_drive("free", speed=10.0, num_steps=91, others=CROWD),
    ]
    lake = write_lake(tmp_path / "lake", drives)
    lake.filter("true", name="both")
    return lake


def test_only_the_partner_and_the_moments_around_the_contact_are_kept(crowded):
    evaluation = plan_evaluation(crowded, "both", "constant-planner", tracker="perfect")
    (name,) = [each for each in crowded.database("both").scenario_ids if each.endswith("crash")]
    reduction = reduce_failure(ReductionJob(evaluation, name))
    smallest, failure = reduction.scenarios[-1], reduction.failures[-1]
    assert smallest.tracks.ids.tolist() == ["t0", "t4"] and failure.partner == "t4"
    assert failure.kind.startswith("collision with a vehicle")
    # Contact after (60 - 4.6) / 10 = 5.54 s of driving at 10 m/s; from 1 s before to 0.2 s after.
    assert reduction.failures[0].time == pytest.approx(5.6) and smallest.timestamps[-1] == pytest.approx(1.2)
    assert failure.time == pytest.approx(1.0)
    assert DriveOnce(evaluation)(smallest) == failure, "again, bit by bit"
    free = next(each for each in crowded.database("both").scenario_ids if each.endswith("free"))
    assert reduce_failure(ReductionJob(evaluation, free)) is None


@pytest.mark.integration
def test_the_folder_of_failures_fails_for_the_new_policy_and_passes_for_the_old_one(crowded, tmp_path):
    folder = tmp_path / "failures"
    plan = RegressionPlan("idm-planner", "constant-planner", tracker="perfect")
    found = regress(crowded, "both", plan, folder=folder)
    (reproduction,) = found.reproductions
    assert reproduction.road_users == 1 and reproduction.is_exact and reproduction.parent.endswith("crash")
    assert found.notes == () and reproduction.seconds < 3.0
    (scenario,) = ScenarioLoader(Lake(folder / "pack"), "failures")
    assert scenario.id == reproduction.scenario_id
    assert set(scenario.tracks.object_type.tolist()) == {ObjectType.VEHICLE}
    assert list(folder.glob("openscenario/*.xosc")) and list(folder.glob("rerun/*.rrd"))
    for policy, failed in (("constant-planner", 1), ("idm-planner", 0), ("", 1)):
        chosen = {"POLICY": policy} if policy else {}
        words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder / "test_failures.py")]
        done = subprocess.run(words, env=os.environ | chosen, capture_output=True, text=True, cwd=folder)
        assert done.returncode == failed and f"1 {'failed' if failed else 'passed'}" in done.stdout, done.stdout
    again = drive_again(folder, scenario.id, "constant-planner")
    assert again.is_exact and again.is_as_bad and again.kind == again.before == reproduction.kind
    index = json.loads((folder / "failures.json").read_text())
    assert index["conditions"]["tracker"] == "perfect"
    with pytest.raises(BadParameter, match="no reproduction of other"):
        drive_again(folder, "other", "constant-planner")
    with pytest.raises(BadParameter, match="exists; choose another folder"):
        regress(crowded, "both", plan, folder=folder)


@pytest.mark.integration
def test_failures_of_random_policies_are_not_reduced(crowded, tmp_path):
    found = regress(crowded, "both", RegressionPlan("idm-planner", "random"), folder=tmp_path / "failures")
    assert found.reproductions == () and "random, by its seed" in found.notes[0]


def test_the_smallest_scenario_that_the_old_policy_passes_is_taken(crowded):
    """It may fail smaller ones, too: what has been left out may have been what saves it."""
    evaluation = plan_evaluation(crowded, "both", "constant-planner", tracker="perfect")
    of_name = {each.id.rpartition("/")[2]: each for each in ScenarioLoader(crowded, "both")}
    crash, free = of_name["crash"], of_name["free"]
    failure = DriveOnce(evaluation)(crash)
    for scenarios, number in (((crash, free, free), 2), ((free, free, crash), 1), ((crash, crash), 0)):
        reduction = Reduction(scenarios, (failure,) * len(scenarios))
        assert smallest_passing((evaluation, reduction)) == (scenarios[0].id, number)


def test_windows_in_which_the_contact_does_not_follow_are_not_taken(tmp_path):
    """The recorded ego stops after 2 s, the policy goes on: it only meets the car if it begins before."""
    drive = make_drive("stops", speed=10.0, num_steps=91, others=(STOPPED,))
    position, velocity = drive.tracks.position.copy(), drive.tracks.velocity.copy()
    position[0, 20:], velocity[0, 20:] = position[0, 20], 0.0
    stops = replace(drive, tracks=replace(drive.tracks, position=position, velocity=velocity))
    lake = write_lake(tmp_path / "lake", [stops])
    reduction = reduce_failure(
        ReductionJob(plan_evaluation(lake, None, "constant-planner", tracker="perfect"), stops.id)
    )
    assert len({(each.kind, each.partner) for each in reduction.failures}) == 1
    assert [round(float(each.timestamps[-1]), 1) for each in reduction.scenarios] == [9.0, 5.8, 4.0]
