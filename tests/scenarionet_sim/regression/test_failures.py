"""Kinds of failures from rows of results."""

from __future__ import annotations

import pytest

from scenarionet_sim.regression.failures import clustered, failure_kind, failure_of, severity


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        (
            {"first_collision": 3.0, "collided_vehicles": 1, "active_front_collisions": 1},
            "collision with a vehicle, ahead",
        ),
        ({"first_collision": 3.0, "collided_vehicles": 1, "collided_humans": 1}, "collision with a person"),
        ({"first_collision": 9.1, "collided_vehicles": 1}, ""),  # with what stands where its recording ended
        ({"first_collision": None, "red_light_violations": 1, "timeout": True}, "red light"),
        ({"off_road_time": 0.3, "out_of_road": True}, "off the road"),
        ({"off_road_time": None, "out_of_road": True, "timeout": False}, "left its route"),
        ({"error": "ValueError: x", "first_collision": 1.0}, "could not be simulated"),
        ({}, ""),
    ],
)  # fmt: skip
def test_the_kind_is_the_worst_that_happened(row, kind):
    assert failure_kind(row, 9.0) == kind


def test_severities_rise():
    kinds = ("", "too slow", "off the road", "red light", "collision with a person", "could not be simulated")
    assert [*map(severity, kinds)] == sorted({severity(each) for each in kinds})


def test_failures_of_one_kind_and_speed_are_together_and_those_that_lose_most_come_first():
    def failure(name, change, speed=3.0, **row):
        return failure_of({"scenario_id": name, "mean_speed": speed, **row}, change, 9.0)

    slow = [failure("a", -0.1, timeout=1), failure("b", -0.3, timeout=1)]
    others = [failure("c", -0.9, off_road_time=1.0), failure("d", -0.2, 16.0, timeout=1)]
    found = clustered([*slow, *others])
    assert [(each.kind, each.speed, [one.scenario_id for one in each.failures]) for each in found] == [
        ("off the road", "slow", ["c"]), ("too slow", "slow", ["b", "a"]), ("too slow", "fast", ["d"]),
    ]  # fmt: skip
