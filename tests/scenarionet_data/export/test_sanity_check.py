"""Invalid scenario descriptions are refused with an error that names the defect."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.export import sanity_check, to_pickle_dict
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.scenarios import make_scenario


def at(*path: str) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def find(description: dict[str, Any]) -> dict[str, Any]:
        for key in path:
            description = description[key]
        return description

    return find


def remove(*path: str) -> Callable[[dict[str, Any]], Any]:
    return lambda d: at(*path[:-1])(d).pop(path[-1])


def put(value: Any, *path: str) -> Callable[[dict[str, Any]], Any]:
    return lambda d: at(*path[:-1])(d).update({path[-1]: value})


T = 31
TRACK, LIGHT, LANE = ("tracks", "t1"), ("dynamic_map_states", "lane0"), ("map_features", "lane1")
STATE, SHOWN = (*TRACK, "state"), (*LIGHT, "state", "object_state")
SUMMARY = ("metadata", "object_summary", "t1")
LEVEL_1 = ("id", "version", "length", "tracks", "dynamic_map_states", "map_features", "metadata")
METADATA = ("id", "dataset", "scenario_id", "coordinate", "metadrive_processed", "sdc_id", "ts", "object_summary",
            "number_summary")  # fmt: skip
STATES = ("position", "heading", "velocity", "valid", "length", "width", "height")
REMOVED = [
    *[(key,) for key in LEVEL_1],
    *[("metadata", key) for key in METADATA],
    *[(*TRACK, key) for key in ("type", "state", "metadata")],
    *[(*STATE, key) for key in STATES],
    *[(*TRACK, "metadata", key) for key in ("type", "object_id")],
    *[(*LIGHT, key) for key in ("type", "state", "stop_point", "metadata")],
    SHOWN,
    *[(*LIGHT, "metadata", key) for key in ("type", "object_id")],
    *[(*LANE, key) for key in ("type", "polyline")],
    ("map_features", "line0", "polyline"),
    ("map_features", "cross", "polygon"),
    (*SUMMARY, "moving_distance"),
    SUMMARY,
    *[("metadata", "number_summary", key) for key in ("num_objects", "num_traffic_lights")],
]
WRONG = {
    **{f"{key} of another kind": put([], key) for key in LEVEL_1},
    **{f"metadata.{key} of another kind": put([], "metadata", key) for key in METADATA},
    **{
        f"state.{key} one step short": lambda d, k=key: at(*STATE)(d).update({k: at(*STATE)(d)[k][:-1]})
        for key in STATES
    },
    **{
        f"state.{key} as a list": lambda d, k=key: at(*STATE)(d).update({k: at(*STATE)(d)[k].tolist()})
        for key in STATES
    },
    "no timestep": put(0, "length"),
    "length as bool": put(True, "length"),
    "a track that is no dict": put([], *TRACK),
    "a type that is not set": put("UNSET", *TRACK, "type"),
    "a type MetaDrive lacks": put("TRAFFIC_OBJECT", *TRACK, "type"),
    "positions in the plane": put(np.zeros((T, 2), np.float32), *STATE, "position"),
    "positions that are no numbers": put(np.full((T, 3), None), *STATE, "position"),
    "positions that are NaN": put(np.full((T, 3), np.nan), *STATE, "position"),
    "velocities in space": put(np.zeros((T, 3), np.float32), *STATE, "velocity"),
    "sizes of two columns": put(np.zeros((T, 2), np.float32), *STATE, "length"),
    "an extra state of other length": put(np.zeros(T + 1), *STATE, "steering"),
    "an extra state without columns": put(np.zeros((T, 0)), *STATE, "steering"),
    "an extra state of three dimensions": put(np.zeros((T, 2, 2)), *STATE, "steering"),
    "an extra state that is a number": put(1.0, *STATE, "steering"),
    "a track of another name": put("t2", *TRACK, "metadata", "object_id"),
    "an id that is no str": lambda d: d["tracks"].update({7: d["tracks"].pop("t1")}),
    "a NumPy scalar": put(np.float32(1), "metadata", "sample_rate"),
    "a NumPy float64, a float by inheritance": put(np.float64(1), "metadata", "sample_rate"),
    "a NumPy bool": put(np.bool_(True), "metadata", "metadrive_processed"),
    "a NumPy scalar in a list": put([np.int64(1)], "metadata", "objects_of_interest"),
    "a class of one's own": put(Path("x"), "metadata", "source_file"),
    "a light of another type": put("VEHICLE", *LIGHT, "type"),
    "light states one short": lambda d: at(*SHOWN)(d).pop(),
    "light states unknown": put(["PURPLE"] * T, *SHOWN),
    "a stop point of one coordinate": put(np.zeros(1), *LIGHT, "stop_point"),
    "a stop point that is NaN": put(np.full(3, np.nan), *LIGHT, "stop_point"),
    "a stop point that is nowhere": put(None, *LIGHT, "stop_point"),
    "a light of another name": put("lane9", *LIGHT, "metadata", "object_id"),
    "a lane without points": put(np.zeros((0, 3)), *LANE, "polyline"),
    "a lane of four coordinates": put(np.zeros((5, 4)), *LANE, "polyline"),
    "a lane of words": put([["a", "b"]], *LANE, "polyline"),
    "a ragged lane": put([[1.0, 2.0], [1.0]], *LANE, "polyline"),
    "a lane that is NaN": put(np.full((5, 3), np.nan), *LANE, "polyline"),
    "a polygon far from its lane": put(np.full((5, 2), 500.0), *LANE, "polygon"),
    "a lane's outline in space": put(np.zeros((5, 3)), *LANE, "polygon"),
    "a crosswalk of two points": put(np.zeros((2, 3)), "map_features", "cross", "polygon"),
    "a feature that is no dict": put(None, *LANE),
    "times as a list": put([0.1] * T, "metadata", "ts"),
    "times one short": put(np.zeros(T - 1), "metadata", "ts"),
    "an ego that is no track": put("nobody", "metadata", "sdc_id"),
    "an ego named by a number": put(0, "metadata", "sdc_id"),
    "a distance that is no number": put("far", *SUMMARY, "moving_distance"),
}


@pytest.fixture(scope="module")
def healthy() -> dict[str, Any]:
    return to_pickle_dict(replace(make_scenario(1), tracks=_vehicles(make_scenario(1))))


def _vehicles(scenario: ScenarioDescription) -> Any:
    return replace(scenario.tracks, object_type=np.ones(12, np.uint8))


def test_valid_description_passes(healthy: dict[str, Any]) -> None:
    sanity_check(healthy)


@pytest.mark.parametrize("path", REMOVED, ids=".".join)
def test_missing_field_is_named(path: tuple[str, ...], healthy: dict[str, Any]) -> None:
    damaged = copy.deepcopy(healthy)
    remove(*path)(damaged)
    with pytest.raises(InvalidScenario) as error:
        sanity_check(damaged)
    assert path[-1] in error.value.field or path == SUMMARY


@pytest.mark.parametrize("how", WRONG)
def test_invalid_field_is_refused(how: str, healthy: dict[str, Any]) -> None:
    damaged = copy.deepcopy(healthy)
    WRONG[how](damaged)
    with pytest.raises(InvalidScenario):
        sanity_check(damaged)


def test_other_mappings_are_refused(healthy: dict[str, Any]) -> None:
    class Dictionary(dict[str, Any]):
        pass

    with pytest.raises(InvalidScenario, match="expected a plain dict"):
        sanity_check(Dictionary(healthy))
