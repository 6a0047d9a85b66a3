"""Compiled relations have the rows of their SQL, on objects that move anywhere, come and go, on lanes and off them."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import QueryError
from scenarionet_data.operations import compiled_relations
from scenarionet_data.operations.compiled_relations import CompiledRelations
from scenarionet_data.operations.moments import relation
from scenarionet_data.query.named_sql import RELATIONS
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import along, lane, moment

ROAD = [
    lane("right", (-60, 0), (0, 0), exit_lanes=["next"], left_neighbors=["left"]),
    lane("next", (0, 0), (60, 0), entry_lanes=["right"], left_neighbors=["left"]),
    lane("left", (-60, 3.5), (60, 3.5), left_neighbors=["back"], right_neighbors=["right", "next"]),
    lane("back", (60, 7), (-60, 7), left_neighbors=["left"]),
]
COMPILED = [
    *(("near_objects", {"distance_thresh": limit}) for limit in (0.5, 4.0, 10.0)),
    *(
        ("has_objects_in_relative_direction", {"direction": way, "within_distance": 12.0, "lateral_thresh": aside})
        for way in ("forward", "backward", "left", "right")
        for aside in (0.0, float("inf"))
    ),
    ("facing_toward", {"max_distance": 8.0}),
    ("facing_toward", {"within_angle": 120.0}),
    ("heading_toward", {}),
    ("heading_toward", {"max_distance": 6.0, "angle_threshold": 60.0, "minimum_speed": 2.0}),
    *(("heading_in_relative_direction_to", {"direction": way}) for way in ("same", "opposite", "perpendicular")),
    *(
        ("being_crossed_by", {"direction": way, "in_direction": side, "forward_thresh": 30.0})
        for way in ("forward", "backward", "left", "right")
        for side in ("either", "clockwise", "counterclockwise")
    ),
    ("in_same_lane", {}),
    *(("on_relative_side_of_road", {"side": side}) for side in ("same", "opposite")),
    ("following", {}),
]


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Two scenarios of twelve objects each; half of them stay near the road, and a third is seen for a while only."""
    rng = np.random.default_rng(4)
    scenarios = []
    for name in ("first", "second"):
        objects = {}
        for k in range(12):
            start = rng.uniform((-40, -1), (40, 8)) if k % 2 else rng.uniform(-30, 30, 2)
            speed = (*rng.uniform(-9, 9, 1), rng.normal(0, 0.3)) if k % 2 else tuple(rng.uniform(-4, 4, 2))
            first = int(rng.integers(0, 50))
            seen = slice(first, int(rng.integers(first + 1, 101))) if k % 3 == 0 else slice(None)
            objects[f"o{k}"] = along(*start, *speed, seen=seen)
        scenarios.append(moment(name, along(-20, 0, 4), ROAD, **objects))
    return write_lake(tmp_path_factory.mktemp("compiled") / "lake", scenarios)


def rows(steps, by):
    return by.arrow(f"SELECT * FROM (\n{steps.sql}\n) ORDER BY ALL").to_pylist()


@pytest.mark.integration
@pytest.mark.parametrize(("name", "parameters"), COMPILED)
def test_compiled_and_sql_find_the_same(lake, name, parameters, monkeypatch):
    steps, asked = relation(name, parameters), []
    find = compiled_relations.find_spans
    monkeypatch.setattr(compiled_relations, "find_spans", lambda *given: asked.append(1) or find(*given))
    compiled = CompiledRelations(lake.keeping)
    for each in (steps, steps.lasting(0.3), steps & steps.reversed()):
        found = rows(each, compiled)
        assert found == rows(each, lake.keeping)
        assert found or each is not steps
    assert len(asked) == 1


def test_what_counts_others_is_left_to_sql(lake, monkeypatch):
    monkeypatch.setattr(compiled_relations, "find_spans", None)
    compiled = CompiledRelations(lake.keeping)
    for name, parameters in (
        ("near_objects", {"min_objects": 2}),
        ("has_objects_in_relative_direction", {"max_number": 1}),
        ("has_objects_in_relative_direction", {"min_number": 3}),
        ("has_velocity", {}),
    ):
        assert rows(relation(name, parameters), compiled) == rows(relation(name, parameters), lake.keeping)
    with pytest.raises(QueryError, match="wanted forward, backward, left or right, found up"):
        rows(relation("being_crossed_by", {"direction": "up"}), compiled)


def test_every_relation_of_two_is_compared():
    of_two = {name for name in RELATIONS.names() if "other_id" in RELATIONS.load(name).text}
    assert {name for name, _ in COMPILED} == of_two
