"""Overlap between two databases: each criterion on a lake with a known answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter, UnknownQuery
from scenarionet_data.query.members import StaleDatabaseWarning
from scenarionet_data.query.named_sql import OVERLAPS
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed


def found(lake, *names):
    return {each.kind: each for each in lake.overlap(*names)}


def ids(*numbers):
    return [f"made/v1/s{number:03d}" for number in numbers]


@pytest.mark.long
def test_shared_logs_and_overlapping_seconds(logs):
    logs.filter(name="a", ids=ids(0, 1, 8))
    logs.filter(name="b", ids=ids(1, 2, 3, 40))  # 0 to 3 are of log00, windows of 3 s, 2 s apart
    shared = found(logs, "a", "b")
    assert (shared["same_scenario"].num_first, shared["same_scenario"].num_second) == (1, 1)
    assert shared["same_scenario"].examples == ((*ids(1, 1, 1),),)
    assert (shared["same_log"].num_first, shared["same_log"].num_second) == (2, 3)
    assert shared["same_log"].examples[0][0] == "made/log00"
    windows = shared["overlapping_window"]
    assert (windows.num_first, windows.num_second) == (2, 2)  # 0 and 1 with 1 and 2
    assert shared["same_content"].examples == ()
    assert shared["same_log"].doc


def test_adjacent_windows_do_not_overlap(logs):
    logs.filter(name="a", ids=ids(0))
    logs.filter(name="b", ids=ids(2))
    assert found(logs, "a", "b")["overlapping_window"].examples == ()


def test_scenarios_without_a_log_share_none(logs):
    logs.filter(name="a", ids=ids(110))
    logs.filter(name="b", ids=ids(111))
    assert found(logs, "a", "b")["same_log"].examples == ()


@pytest.fixture
def twins(tmp_path):
    """Scenario 1, with another id, translated, slightly shifted, and shifted too far; 9 is unrelated."""
    one = make_scenario(1, num_objects=4)

    def shifted(name, by, noise=0.0):
        position = one.tracks.position.copy()
        position[one.ego_index, 5:, 1] += np.float32(noise)
        tracks = replace(one.tracks, position=position)
        return replace(renamed(one, name), origin=one.origin + by, tracks=tracks)

    others = [renamed(one, "same"), shifted("moved", 250.0), shifted("near", 0.0, 0.05), shifted("far", 0.0, 0.3)]
    parked = [replace(make_scenario(k, num_objects=1, num_steps=3)) for k in (20, 21)]  # 2 m
    return write_lake(tmp_path, [one, *others, make_scenario(9, num_objects=4, num_steps=40), *parked])


def test_equal_content_and_equal_drives_are_found(twins):
    one = make_scenario(1).id
    twins.filter(name="one", ids=[one])
    twins.filter(name="rest", database=None, where=f"scenario_id <> '{one}'")
    shared = found(twins, "one", "rest")
    assert shared["same_scenario"].examples == ()
    assert shared["same_content"].num_second == 1
    assert shared["same_content"].examples[0][1:] == (one, "made/v1/same")
    drives = shared["near_duplicate"]
    assert (drives.num_first, drives.num_second) == (1, 3)
    twins.filter(name="dups", ids=[f"made/v1/{name}" for name in ("same", "moved", "near")])
    twins.subtract("rest", "dups", name="clean")
    assert [each.kind for each in twins.overlap("one", "clean") if each.examples] == ["same_log"]


def test_parked_egos_are_not_all_equal(twins):
    twins.filter(name="a", ids=[make_scenario(20).id])
    twins.filter(name="b", ids=[make_scenario(21).id])
    assert found(twins, "a", "b")["near_duplicate"].examples == ()


def test_several_databases_are_compared_pairwise(logs):
    for name in "abc":
        logs.filter(name=name, ids=ids(1, ord(name)))
    pairs = [(each.first, each.second) for each in logs.overlap("a", "b", "c", kinds=["same_scenario"])]
    assert pairs == [("a@1", "b@1"), ("a@1", "c@1"), ("b@1", "c@1")]
    assert all(each.num_first == 1 for each in logs.overlap("a", "b", "c", kinds=["same_scenario"]))


def test_invalid_arguments_are_refused(logs):
    logs.filter(name="a", ids=ids(1))
    with pytest.raises(BadParameter, match="wanted two databases or more, found 1"):
        logs.overlap("a")
    with pytest.raises(UnknownQuery, match="did you mean same_log"):
        logs.overlap("a", "a", kinds=["same_logs"])
    assert OVERLAPS.names() == ["near_duplicate", "overlapping_window", "same_content", "same_log", "same_scenario"]


def test_missing_members_are_reported(changed):
    with pytest.warns(StaleDatabaseWarning, match="1 of 3 members of old@1 are not in snapshot"):
        shared = found(changed, "old", "same")
    assert shared["same_scenario"].num_first == 1
