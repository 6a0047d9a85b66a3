"""Moments defined in a TOML file: the same SELECT as composed in Python, and sentences for what is none."""

from __future__ import annotations

import json

import pytest

from scenarionet_data.errors import BadParameter, UnknownRelation
from scenarionet_data.operations.definitions import Definitions
from scenarionet_data.operations.moments import event, relation, selected

NEAR = relation("near_objects", {"distance_thresh": 5.0})
CAR = relation("is_category", {"category": "VEHICLE"})
EXPRESSIONS = {
    "near_objects": relation("near_objects").lasting(),
    "near_objects(distance_thresh=5)": NEAR.lasting(),
    "near_objects(distance_thresh=5) & ~is_category(category='VEHICLE')": (NEAR & ~CAR).lasting(),
    "(near_objects(distance_thresh=5) | near_objects(distance_thresh=5).reversed()).lasting(1)": (
        (NEAR | NEAR.reversed()).lasting(1)
    ),
    "near_objects(distance_thresh=5).at_least(2)": NEAR.at_least(2).lasting(),
    "hard_braking().before(near_objects(distance_thresh=5), within=2.5)": event("hard_braking").before(
        NEAR.lasting(), within=2.5
    ),
    "accelerating(min_accel=-3.0, max_accel=-1.0)": relation(
        "accelerating", {"min_accel": -3.0, "max_accel": -1.0}
    ).lasting(),
}


def written(tmp_path, text):
    path = tmp_path / "moments.toml"
    path.write_text(text)
    return path


def defined(tmp_path, **expressions):
    tables = (f"[{name}]\ndoc = 'What {name} is.'\nwhen = {json.dumps(text)}\n" for name, text in expressions.items())
    return Definitions(written(tmp_path, "".join(tables)))


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_expressions_are_those_of_python(tmp_path, expression):
    assert defined(tmp_path, found=expression)["found"] == EXPRESSIONS[expression]


def test_definitions_use_each_other(tmp_path):
    definitions = defined(tmp_path, close="near_objects(distance_thresh=5)", long="close.lasting(2)")
    assert definitions["long"] == NEAR.lasting(2)
    assert definitions.docs == {"close": "What close is.", "long": "What long is."}
    assert "other" not in definitions


def test_sql_of_your_own_composes_with_the_others(tmp_path):
    sql = "SELECT scenario_id, track_id, 3 AS first_timestep, 9 AS last_timestep, 0.5 AS value FROM objects"
    text = f"[mine]\nsql = {json.dumps(sql)}\n[both]\nwhen = 'mine.during(stationary)'\n"
    definitions = Definitions(written(tmp_path, text))
    assert definitions["mine"] == selected(sql) and definitions["mine"].measures == ("value",)
    assert definitions["both"] == selected(sql).during(relation("stationary").lasting())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\nsql = 'SELECT 1'", "it lacks first_timestep, last_timestep, scenario_id"),
        ("[a]\nsql = 'SELECT scenario_id, first_timestep, last_timestep FROM x'", "it lacks track_id or other_id"),
        ("[a]\nsql = 'SELECT 1'\nwhen = 'stationary'", r"\[a\] wants a text `when`, or `sql`"),
        ("[a]\nwhen = 'stationary'\n[a]\nwhen = 'turning'", "no definitions can be read"),
    ],
)
def test_sql_that_is_no_definition_is_refused(tmp_path, text, message):
    with pytest.raises(BadParameter, match=message):
        Definitions(written(tmp_path, text))


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("found.lasting(1)", r"\[found\]: it is defined by itself: found -> found"),
        ("second & stationary", r"\[second\]: it is defined by itself: found -> second -> found"),
        ("near_objects(", r"\[found\] is no expression"),
        ("3", r"\[found\] is no relation, event or composition"),
        ("near_objects + stationary", "'near_objects \\+ stationary' is none of"),
        ("__import__('os').system('true')", "__import__.* is none of"),
        ("near_objects.sql", "is none of"),
        ("near_objects.write(1)", "there is no method 'write'; there are lasting, before"),
        ("near_objects.before(stationary, within=1)", r"\.before\(\) wants spans of time: add \.lasting\(\) before it"),
        ("hard_braking.reversed()", r"\.reversed\(\) wants single steps"),
        ("hard_braking & stationary", r"&, \| and ~ combine relations at single steps, found 'hard_braking'"),
        ("near_objects.at_least()", r"\.at_least\(\): .*missing"),
        ("near_objects.at_least(1.5)", r"\[found\]: \.at_least\(\): at_least\(1.5\) of track and other: wanted"),
        ("near_objects.lasting(-1)", r"\[found\]: \.lasting\(\): wanted a number of seconds from 0 on"),
        ("near_objects(distance=3)", r"\[found\]: near_objects has no parameter 'distance'"),
        ("near_object", r"\[found\]: no definition, relation or event 'near_object'; did you mean near_objects"),
        ("second(x=1)", "definitions have no parameters"),
    ],
)  # fmt: skip
def test_what_is_no_definition_is_a_sentence(tmp_path, expression, message):
    definitions = defined(tmp_path, found=expression, second="found")
    with pytest.raises((BadParameter, UnknownRelation), match=message):
        definitions["found"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\nwhen = 'x'\n[a]\nwhen = 'y'", "no definitions can be read"),
        ("a = 3", r"\[a\] wants a text `when`"),
        ("[a]\nwhen = 'x'\ncolour = 'red'", r"\[a\] wants a text `when`"),
        ("[cut_in]\nwhen = 'stationary'", r"\[cut_in\] has the name of a relation or event"),
    ],
)
def test_what_is_no_file_of_definitions_is_a_sentence(tmp_path, text, message):
    with pytest.raises(BadParameter, match=message):
        Definitions(written(tmp_path, text))
    with pytest.raises(BadParameter, match="no definitions can be read"):
        Definitions(tmp_path / "missing.toml")
