from __future__ import annotations

import re

import numpy as np
import pytest

from scenarionet_data.building import plausible
from scenarionet_data.building.plausible import find_bad_geometry, find_bad_rows, find_repeated_rows
from scenarionet_data.schema.package_data import SQL


def rows(count=6):
    """Boxes around an ego at (600,000, 4,000,000)."""
    reference = np.array([6e5, 4e6])
    position = np.concatenate([reference + np.arange(count)[:, None] * 10.0, np.ones((count, 1))], axis=1)
    return {
        "position": position,
        "heading": np.linspace(-3, 3, count),
        "velocity": np.full((count, 2), 5.0),
        "size": np.full((count, 3), 2.0, np.float32),
        "reference": reference,
    }


BAD = [
    ("position", (1, 2), np.nan, "expected finite metres"),
    ("position", (1, 0), 1e12, "within 10,000 m of the ego, found 1e+12"),
    ("position", (1, 0), 6e5 + 10_001, "within 10,000 m"),
    ("heading", 1, np.inf, "expected finite radians, found inf"),
    ("size", (1, 1), 0.0, "above 0 and up to 200 m, found 2, 0, 2"),
    ("size", (1, 2), -1.0, "above 0"),
    ("size", (1, 0), np.nan, "above 0"),
    ("size", (1, 0), 1e9, "up to 200 m"),
    ("velocity", (1, 1), 151.0, "up to 150 m/s, found 5, 151"),
    ("velocity", (1, 1), np.nan, "up to 150 m/s"),
]


@pytest.mark.parametrize(("field", "index", "value", "reason"), BAD)
def test_row_that_cannot_be_is_found_with_its_reason(field, index, value, reason):
    given = rows()
    given[field][index] = value
    (found,) = find_bad_rows(**given)
    assert found.mask.tolist() == [False, True, False, False, False, False]
    assert found.field == field
    assert reason in found.reason


def test_good_rows_and_no_rows_have_no_faults():
    assert find_bad_rows(**rows()) == []
    assert find_bad_rows(**rows(0)) == []
    assert find_bad_rows(**rows() | {"velocity": None, "size": None}) == []


def test_row_with_several_faults_is_counted_once():
    given = rows()
    given["position"][2] = given["heading"][2] = np.nan
    given["heading"][3] = np.nan
    found = find_bad_rows(**given)
    assert [(each.field, np.flatnonzero(each.mask).tolist()) for each in found] == [("position", [2]), ("heading", [3])]


def test_later_rows_of_a_track_and_time_are_repeated():
    found = find_repeated_rows(np.array([4, 5, 4, 4, 4]), np.array([0, 0, 1, 0, 1]))
    assert found.mask.tolist() == [False, False, False, True, True]
    assert find_repeated_rows(np.array([4, 5, 4]), np.array([0, 0, 1])) is None


def test_geometry_that_cannot_be():
    line = np.array([[0.0, 0.0, 0.0], [5.0, 5.0, 0.0]])
    assert find_bad_geometry(line, np.zeros(2)) is None
    assert "finite metres, found no number, 1" in find_bad_geometry(np.array([[np.nan, 1.0]]), np.zeros(2))
    assert "within 200,000 m of the map's centre, found 1e+12" in find_bad_geometry(line + 1e12, np.zeros(2))


def test_check_of_lakes_has_the_same_bounds():
    text = (SQL / "checks" / "states_are_plausible.sql").read_text("utf-8")
    for name, bound in (
        ("distance", plausible.MAX_DISTANCE),
        ("size", plausible.MAX_SIZE),
        ("speed", plausible.MAX_SPEED),
    ):
        assert {float(number) for number in re.findall(rf"{name} > (\d+)", text)} == {bound}
