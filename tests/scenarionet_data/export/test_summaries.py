"""Summaries of pickles match ScenarioNet's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.export import to_pickle_dict
from scenarionet_data.export.summary import map_height_diff, summarize_object
from scenarionet_data.ingest.options import Options
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState
from tests.fixtures.scenarios import with_lights

CONVERTER = ScenarioNetPickles()


def import_all(directory: Path) -> list[ScenarioDescription]:
    shards = CONVERTER.shards(str(directory), "train", "v1", Options())
    return [CONVERTER.scenario(shard, record) for shard in shards for record in CONVERTER.records(shard)]


def test_object_summary() -> None:
    position = np.array([[0, 0, 9], [3, 4, 0], [99, 99, 0], [3, 5, 0], [3, 6, 0], [7, 7, 7]], np.float32)
    valid = np.array([True, True, False, True, True, False])
    track = {"type": "VEHICLE", "state": {"position": position, "valid": valid}}
    assert summarize_object("7", track) == {
        "type": "VEHICLE",
        "object_id": "7",
        "track_length": 6,
        "moving_distance": 7.0,
        "valid_length": 4,
        "continuous_valid_length": 2,
    }
    never = summarize_object("7", {"type": "VEHICLE", "state": {"position": position, "valid": np.zeros(6, bool)}})
    assert (never["moving_distance"], never["valid_length"], never["continuous_valid_length"]) == (0, 0, 0)


def test_number_summary() -> None:
    states = [[LightState.ABSENT, LightState.LANE_STATE_GO, LightState.LANE_STATE_GO, LightState.LANE_STATE_STOP]]
    scenario = with_lights(states, ["lane1"], [[0, 0, 0]])
    description = to_pickle_dict(scenario)
    summary = description["metadata"]["number_summary"]
    distances = [o["moving_distance"] for o in description["metadata"]["object_summary"].values()]
    assert summary["num_objects"] == 12 == sum(summary["num_objects_each_type"].values())
    assert summary["num_moving_objects"] == sum(d > 1 for d in distances)
    assert sum(summary["num_moving_objects_each_type"].values()) == summary["num_moving_objects"]
    assert summary["num_traffic_lights"] == 1
    assert summary["num_traffic_light_types"] == {"LANE_STATE_GO", "LANE_STATE_STOP"}
    assert summary["num_traffic_light_each_step"] == {"LANE_STATE_GO": 2, "LANE_STATE_STOP": 1}
    assert summary["num_map_features"] == len(description["map_features"])


def test_map_height_diff_stops_once_above_ten_metres() -> None:
    def line(*heights: float) -> dict[str, Any]:
        return {"type": "ROAD_LINE_SOLID_SINGLE_WHITE", "polyline": np.array([[0, 0, z] for z in heights])}

    assert map_height_diff({"a": line(1, 3), "b": line(6)}) == 5
    assert map_height_diff({"a": line(0, 11), "b": line(500)}) == 11
    assert map_height_diff({"a": {"type": "ROAD_EDGE_BOUNDARY", "polyline": line(0, 5)["polyline"]}}) == -np.inf


def test_summaries_match_scenarionets_own(recordings: Path) -> None:
    for path in sorted((recordings / "scenarionet").rglob("sd_*waymo*.pkl")):
        (scenario,) = [s for s in import_all(path.parent) if s.source.file == path.name]
        theirs = load(path, path.name)["metadata"]
        ours = to_pickle_dict(scenario)["metadata"]
        for track_id, summary in theirs["object_summary"].items():
            mine = ours["object_summary"][track_id]
            assert mine["moving_distance"] == pytest.approx(summary["moving_distance"], rel=1e-3, abs=1e-2)
            for name in ("type", "track_length", "valid_length", "continuous_valid_length"):
                assert mine[name] == summary[name]
        height = theirs["number_summary"].pop("map_height_diff", None)
        assert ours["number_summary"].items() >= theirs["number_summary"].items()
        assert height is None or ours["number_summary"]["map_height_diff"] == pytest.approx(height, abs=1e-3)
