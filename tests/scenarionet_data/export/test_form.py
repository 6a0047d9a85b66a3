"""Exported scenarios have ScenarioNet's format."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.export import sanity_check, to_pickle_dict
from scenarionet_data.scenario.vocabulary import LightState, ObjectType
from tests.fixtures import scenarionet_pickles as made
from tests.fixtures.scenarios import make_scenario, with_lights


@pytest.mark.parametrize("seed", range(4))
def test_only_builtins_and_owned_arrays(seed: int) -> None:
    scenario = make_scenario(seed, has_z=seed != 3)
    description = to_pickle_dict(scenario)
    allowed = (int, float, str, bool, type(None), dict, list, tuple, set, np.ndarray)
    sources = [getattr(scenario.tracks, name) for name in ("position", "heading", "velocity", "valid", "size")]
    sources += [scenario.timestamps, scenario.origin, scenario.map.polyline.values, scenario.map.polygon.values]
    for path, value in made.walk(description):
        assert type(value) in allowed, path
        if isinstance(value, dict):
            assert all(type(key) is str for key in value), path
        if isinstance(value, np.ndarray):
            assert value.flags.writeable, path
            assert not any(np.shares_memory(value, source) for source in sources), path


def test_tracks_have_one_format() -> None:
    scenario = make_scenario(2)
    description = to_pickle_dict(scenario)
    assert list(description["tracks"]) == scenario.tracks.ids.tolist()
    shapes = {"position": (31, 3), "velocity": (31, 2)}
    for track_id, track in description["tracks"].items():
        assert set(track["state"]) == {"position", "heading", "velocity", "valid", "length", "width", "height"}
        for name, array in track["state"].items():
            assert array.shape == shapes.get(name, (31,))
            assert array.dtype == (bool if name == "valid" else np.float32)
            assert not array[~track["state"]["valid"]].any()
        assert track["metadata"]["object_id"] == track_id
        assert track["metadata"]["track_length"] == 31


def test_metadata() -> None:
    scenario = make_scenario(2)
    metadata = to_pickle_dict(scenario)["metadata"]
    assert metadata["id"] == metadata["scenario_id"] == "s000002"
    assert (metadata["dataset"], metadata["sdc_id"], metadata["sdc_track_index"]) == ("made", "t0", 0)
    assert metadata["ts"].tolist() == scenario.timestamps.tolist()
    assert metadata["origin"].tolist() == scenario.origin.tolist()
    assert metadata["tracks_to_predict"]["t1"] == {
        "track_index": 1,
        "track_id": "t1",
        "difficulty": 2,
        "object_type": to_pickle_dict(scenario)["tracks"]["t1"]["type"],
    }
    assert (metadata["source_file"], metadata["log_name"], metadata["map"]) == ("file0", "log0", "nowhere")


def test_types_unknown_to_metadrive_become_other() -> None:
    scenario = make_scenario(1)
    types = scenario.tracks.object_type.copy()
    types[1:3] = ObjectType.UNSET, ObjectType.TRAFFIC_OBJECT
    tracks = to_pickle_dict(replace(scenario, tracks=replace(scenario.tracks, object_type=types)))["tracks"]
    assert [tracks[i]["type"] for i in ("t1", "t2")] == ["OTHER", "OTHER"]
    assert [tracks[i]["metadata"]["object_type"] for i in ("t1", "t2")] == ["UNSET", "TRAFFIC_OBJECT"]
    assert tracks["t1"]["metadata"]["type"] == "car"


def test_map_features() -> None:
    features = to_pickle_dict(make_scenario(1))["map_features"]
    lane = features["lane1"]
    assert lane["entry_lanes"] == ["lane0"] and lane["exit_lanes"] == ["lane2"]
    assert lane["left_neighbor"] == ["lane2"] and lane["right_neighbor"] == []
    points = len(lane["polyline"])
    assert lane["left_boundaries"] == [
        {
            "lane_start_index": "0",
            "lane_end_index": str(points - 1),
            "boundary_type": "ROAD_LINE_BROKEN_SINGLE_WHITE",
            "boundary_feature_id": "line0",
        }
    ]
    assert lane["speed_limit_kmh"] == pytest.approx(13.9 * 3.6)
    assert lane["speed_limit_mph"] == pytest.approx(13.9 * 3.6 / 1.609344)
    assert lane["width"].shape == (points, 2) and (lane["width"] == 1.75).all()
    assert lane["polyline"].shape == (points, 3) and lane["polygon"].shape == (2 * points, 2)
    assert lane["is_intersection"] is True and "is_intersection" not in features["lane0"]
    assert "speed_limit_kmh" not in features["lane0"]
    assert features["sign"]["position"].shape == (3,) and features["sign"]["lane"] == ["lane0"]
    assert features["cross"]["polygon"].shape == (4, 3)


def test_maps_without_heights_are_planar() -> None:
    """As ScenarioNet writes them: the height difference is -inf, so no_overpass drops them (ours does not)."""
    planar = to_pickle_dict(make_scenario(1, has_z=False))
    assert planar["map_features"]["lane1"]["polyline"].shape[1] == 2
    assert planar["metadata"]["number_summary"]["map_height_diff"] == -np.inf
    spatial = to_pickle_dict(make_scenario(1))
    assert spatial["metadata"]["number_summary"]["map_height_diff"] > 0


def test_scenario_without_a_map() -> None:
    description = to_pickle_dict(make_scenario(1, has_map=False))
    sanity_check(description)
    assert description["map_features"] == {}


def test_features_metadrive_cannot_read_are_omitted_and_named() -> None:
    scenario = make_scenario(1, num_lanes=4, num_lights=0)
    features = scenario.map
    lists = [points.tolist() for points in features.polyline]
    lists[0] = []
    polygons = [points.tolist() for points in features.polygon]
    polygons[1] = (np.array(polygons[1]) + 200).tolist()
    cross = features.ids.tolist().index("cross")
    polygons[cross] = polygons[cross][:2]
    width = Ragged.from_lists([[]] * len(features), width=2)
    damaged = replace(
        features, polyline=Ragged.from_lists(lists, 3), polygon=Ragged.from_lists(polygons, 3), width=width
    )
    description = to_pickle_dict(replace(scenario, map=damaged))
    sanity_check(description)
    assert description["metadata"]["omitted_map_features"] == ["lane0", "cross"]
    assert description["metadata"]["omitted_polygons"] == ["lane1"]
    assert "polygon" not in description["map_features"]["lane1"]
    assert "omitted_polygons" not in to_pickle_dict(scenario)["metadata"]


def test_light_states_are_names_or_none() -> None:
    states = [LightState.ABSENT, LightState.LANE_STATE_GO, LightState.TRAFFIC_LIGHT_RED]
    description = to_pickle_dict(with_lights([states], ["lane1"], [[1, 2, 3]]))
    light = description["dynamic_map_states"]["lane1"]
    assert light["state"]["object_state"] == [None, "LANE_STATE_GO", "TRAFFIC_LIGHT_RED"]
    assert light["stop_point"].tolist() == [1, 2, 3]
    assert light["lane"] == light["metadata"]["object_id"] == "lane1"


def test_lights_of_one_lane_merge_to_the_most_restrictive() -> None:
    green, red, unknown, absent = (
        LightState.LANE_STATE_GO,
        LightState.LANE_STATE_ARROW_STOP,
        LightState.LANE_STATE_UNKNOWN,
        LightState.ABSENT,
    )
    yellow = LightState.TRAFFIC_LIGHT_YELLOW
    states = [[green, green, unknown, absent, yellow], [red, unknown, absent, absent, green]]
    nowhere = [np.nan] * 3
    description = to_pickle_dict(with_lights(states, ["lane1", "lane1"], [nowhere, [4, 5, 6]]))
    (light,) = description["dynamic_map_states"].values()
    assert light["state"]["object_state"] == [
        "LANE_STATE_ARROW_STOP",
        "LANE_STATE_GO",
        "LANE_STATE_UNKNOWN",
        None,
        "TRAFFIC_LIGHT_YELLOW",
    ]
    assert light["metadata"]["light_ids"] == ["light0", "light1"]
    assert light["stop_point"].tolist() == [4, 5, 6]


def test_light_without_stop_point_is_placed_at_its_lane_start() -> None:
    nowhere = [[np.nan] * 3] * 2
    states = [[LightState.LANE_STATE_GO]] * 2
    scenario = with_lights(states, ["lane1", "elsewhere"], nowhere)
    lights = to_pickle_dict(scenario)["dynamic_map_states"]
    assert lights["lane1"]["stop_point"].tolist() == scenario.map.polyline[1][0].tolist()
    assert lights["elsewhere"]["stop_point"].tolist() == [0, 0, 0]
    assert all(light["metadata"]["is_stop_point_assumed"] for light in lights.values())


@pytest.mark.parametrize(("dataset", "version"), [("nuscenes", "v1.0-mini"), ("other", "nuscenesv1.0-mini")])
def test_nuscenes_ego_is_written_as_metadrive_expects(dataset: str, version: str) -> None:
    scenario = make_scenario(2, dataset=dataset, version=version)
    tracks = to_pickle_dict(scenario)["tracks"]
    true = scenario.tracks.size
    assert tracks["t0"]["state"]["width"].tolist() == true[0, :, 0].tolist()
    assert tracks["t0"]["state"]["length"].tolist() == true[0, :, 1].tolist()
    assert tracks["t1"]["state"]["length"].tolist() == true[1, :, 0].tolist()
