"""What is exported has ScenarioNet's form, is refused when damaged, and comes back as it was."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data.converters.base import Options
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import BadParameter, DatabaseExists, InvalidScenario
from scenarionet_data.pickle_compat import export, sanity_check, to_pickle_dict
from scenarionet_data.pickle_compat.summary import map_height_diff, summarize_object
from scenarionet_data.ragged import Ragged
from scenarionet_data.scenario import Lights, ScenarioDescription, make_scenario_id, strings
from scenarionet_data.testing import differences
from scenarionet_data.vocabulary import LightState, MapFeatureType, ObjectType
from tests.fixtures import scenarionet_pickles as made
from tests.fixtures.scenarios import make_scenario, renamed

CONVERTER = ScenarioNetPickles()


def import_all(directory: Path) -> list[ScenarioDescription]:
    shards = CONVERTER.shards(str(directory), "train", "v1", Options())
    return [CONVERTER.scenario(shard, record) for shard in shards for record in CONVERTER.records(shard)]


# --- the form -----------------------------------------------------------------------------------------


def walk(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    yield path, value
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for key, item in inner:
        yield from walk(item, f"{path}.{key}")


@pytest.mark.parametrize("seed", range(4))
def test_only_builtins_and_arrays_of_its_own(seed: int) -> None:
    scenario = make_scenario(seed, has_z=seed != 3)
    description = to_pickle_dict(scenario)
    allowed = (int, float, str, bool, type(None), dict, list, tuple, set, np.ndarray)
    sources = [getattr(scenario.tracks, name) for name in ("position", "heading", "velocity", "valid", "size")]
    sources += [scenario.timestamps, scenario.origin, scenario.map.polyline.values, scenario.map.polygon.values]
    for path, value in walk(description):
        assert type(value) in allowed, path
        if isinstance(value, dict):
            assert all(type(key) is str for key in value), path
        if isinstance(value, np.ndarray):
            assert value.flags.writeable, path
            assert not any(np.shares_memory(value, source) for source in sources), path


def test_tracks_have_one_form() -> None:
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


def test_types_metadrive_lacks_become_other() -> None:
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
    """As ScenarioNet's own: their height difference is -inf, so its no_overpass drops them (ours does not)."""
    planar = to_pickle_dict(make_scenario(1, has_z=False))
    assert planar["map_features"]["lane1"]["polyline"].shape[1] == 2
    assert planar["metadata"]["number_summary"]["map_height_diff"] == -np.inf
    spatial = to_pickle_dict(make_scenario(1))
    assert spatial["metadata"]["number_summary"]["map_height_diff"] > 0


def test_a_scenario_without_a_map() -> None:
    description = to_pickle_dict(make_scenario(1, has_map=False))
    sanity_check(description)
    assert description["map_features"] == {}


def test_what_metadrive_cannot_read_is_left_out_and_named() -> None:
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


# --- lights -------------------------------------------------------------------------------------------


def with_lights(states: list[list[LightState]], lanes: list[str], stops: list[list[float]]) -> ScenarioDescription:
    scenario = make_scenario(1, num_steps=len(states[0]), num_lights=0)
    lights = Lights(
        ids=strings([f"light{i}" for i in range(len(lanes))]),
        lane_ids=strings(lanes),
        stop_point=np.array(stops, np.float32),
        state=np.array(states, np.uint8),
        is_lane_in_map=np.isin(strings(lanes).astype(str), scenario.map.ids.astype(str)),
        provenance=np.zeros(len(lanes), np.uint8),
    )
    found = replace(scenario, lights=lights)
    found.validate()
    return found


def test_states_are_names_or_none() -> None:
    states = [LightState.ABSENT, LightState.LANE_STATE_GO, LightState.TRAFFIC_LIGHT_RED]
    description = to_pickle_dict(with_lights([states], ["lane1"], [[1, 2, 3]]))
    light = description["dynamic_map_states"]["lane1"]
    assert light["state"]["object_state"] == [None, "LANE_STATE_GO", "TRAFFIC_LIGHT_RED"]
    assert light["stop_point"].tolist() == [1, 2, 3]
    assert light["lane"] == light["metadata"]["object_id"] == "lane1"


def test_lights_of_one_lane_become_the_most_restrictive() -> None:
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


def test_a_light_without_stop_point_stands_at_its_lanes_start() -> None:
    nowhere = [[np.nan] * 3] * 2
    states = [[LightState.LANE_STATE_GO]] * 2
    scenario = with_lights(states, ["lane1", "elsewhere"], nowhere)
    lights = to_pickle_dict(scenario)["dynamic_map_states"]
    assert lights["lane1"]["stop_point"].tolist() == scenario.map.polyline[1][0].tolist()
    assert lights["elsewhere"]["stop_point"].tolist() == [0, 0, 0]
    assert all(light["metadata"]["is_stop_point_assumed"] for light in lights.values())


# --- nuScenes' ego ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("dataset", "version"), [("nuscenes", "v1.0-mini"), ("other", "nuscenesv1.0-mini")])
def test_metadrive_gets_the_nuscenes_ego_as_it_expects_it(dataset: str, version: str) -> None:
    scenario = make_scenario(2, dataset=dataset, version=version)
    tracks = to_pickle_dict(scenario)["tracks"]
    true = scenario.tracks.size
    assert tracks["t0"]["state"]["width"].tolist() == true[0, :, 0].tolist()
    assert tracks["t0"]["state"]["length"].tolist() == true[0, :, 1].tolist()
    assert tracks["t1"]["state"]["length"].tolist() == true[1, :, 0].tolist()


# --- summaries ----------------------------------------------------------------------------------------


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


def test_map_height_diff_stops_above_ten_metres() -> None:
    def line(*heights: float) -> dict[str, Any]:
        return {"type": "ROAD_LINE_SOLID_SINGLE_WHITE", "polyline": np.array([[0, 0, z] for z in heights])}

    assert map_height_diff({"a": line(1, 3), "b": line(6)}) == 5
    assert map_height_diff({"a": line(0, 11), "b": line(500)}) == 11
    assert map_height_diff({"a": {"type": "ROAD_EDGE_BOUNDARY", "polyline": line(0, 5)["polyline"]}}) == -np.inf


def test_summaries_agree_with_scenarionets_own(recordings: Path) -> None:
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


# --- the sanity check ---------------------------------------------------------------------------------


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


def test_the_healthy_description_passes(healthy: dict[str, Any]) -> None:
    sanity_check(healthy)


@pytest.mark.parametrize("path", REMOVED, ids=".".join)
def test_a_missing_field_is_named(path: tuple[str, ...], healthy: dict[str, Any]) -> None:
    damaged = copy.deepcopy(healthy)
    remove(*path)(damaged)
    with pytest.raises(InvalidScenario) as error:
        sanity_check(damaged)
    assert path[-1] in error.value.field or path == SUMMARY


@pytest.mark.parametrize("how", WRONG)
def test_a_wrong_field_is_refused(how: str, healthy: dict[str, Any]) -> None:
    damaged = copy.deepcopy(healthy)
    WRONG[how](damaged)
    with pytest.raises(InvalidScenario):
        sanity_check(damaged)


def test_other_dictionaries_are_refused(healthy: dict[str, Any]) -> None:
    class Dictionary(dict[str, Any]):
        pass

    with pytest.raises(InvalidScenario, match="wanted a plain dict"):
        sanity_check(Dictionary(healthy))


# --- databases ----------------------------------------------------------------------------------------


def test_a_database(tmp_path: Path) -> None:
    scenarios = [make_scenario(seed) for seed in (3, 1, 2)]
    done: list[int] = []
    report = export(iter(scenarios), tmp_path / "new" / "db", on_progress=done.append)
    names = [f"sd_made_v1_s00000{seed}.pkl" for seed in (3, 1, 2)]
    assert report.directory == tmp_path / "new" / "db"
    assert (report.num_scenarios, report.refused, done) == (3, (), [1, 2, 3])
    assert report.num_bytes == sum((report.directory / name).stat().st_size for name in names)
    assert {p.name for p in report.directory.iterdir()} == {*names, "dataset_summary.pkl", "dataset_mapping.pkl"}
    assert [p.name for p in report.directory.parent.iterdir()] == ["db"]
    summary = load(report.directory / "dataset_summary.pkl", "summary")
    assert list(summary) == names
    assert load(report.directory / "dataset_mapping.pkl", "mapping") == dict.fromkeys(names, "")
    assert not any(isinstance(value, np.ndarray | set) for _, value in walk(summary))
    assert summary[names[0]]["ts"] == scenarios[0].timestamps.tolist()
    assert summary[names[0]]["object_summary"]["t0"]["moving_distance"] == pytest.approx(30, rel=0.02)


def test_pickles_load_in_both_numpys(tmp_path: Path) -> None:
    """Names that numpy 1.26 and 2 share; protocol 4, whose arrays come back writable."""
    directory = export([make_scenario(1)], tmp_path / "db").directory
    for path in directory.iterdir():
        data = path.read_bytes()
        assert data[:2] == b"\x80\x04"
        assert b"_core" not in data and b"multiarray" not in data
        for where, value in walk(pickle.loads(data)):
            assert not isinstance(value, np.ndarray) or value.flags.writeable, where
            assert not isinstance(value, np.ndarray) or value.dtype.isnative, where


def test_file_names_are_scenario_files(tmp_path: Path) -> None:
    odd = replace(make_scenario(1), id=make_scenario_id("made", "v 1", "log/7 é", start=12))
    (path,) = [p for p in export([odd], tmp_path / "db").directory.iterdir() if p.name.startswith("sd_")]
    assert path.name == "sd_made_v%201_log%2F7%20%C3%A9@12.pkl"
    imported = made.metadrive(3)
    made.write_pickle(imported, tmp_path / "pg" / "sd_x.pkl")
    report = export(import_all(tmp_path / "pg"), tmp_path / "again")
    assert (report.directory / "sd_metadrive_MetaDrive%20v0.4.3_PGMap-3.pkl").is_file()


def test_an_existing_directory_is_refused(tmp_path: Path) -> None:
    db = tmp_path / "db"
    export([make_scenario(1)], db)
    with pytest.raises(DatabaseExists, match="is not empty"):
        export([make_scenario(2)], db)
    assert (db / "sd_made_v1_s000001.pkl").is_file()
    export([make_scenario(2)], db, replace=True)
    assert {p.name for p in db.glob("sd_*")} == {"sd_made_v1_s000002.pkl"}
    (tmp_path / "empty").mkdir()
    export([make_scenario(2)], tmp_path / "empty")
    assert (tmp_path / "empty" / "dataset_summary.pkl").is_file()


def test_overwriting_spares_what_is_no_database(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("x")
    with pytest.raises(DatabaseExists, match=r"thesis\.tex"):
        export([make_scenario(1)], tmp_path / "home", replace=True)
    with pytest.raises(DatabaseExists):
        export([make_scenario(1)], tmp_path / "home" / "thesis.tex", replace=True)
    assert (tmp_path / "home" / "thesis.tex").read_text() == "x"


def test_a_broken_run_leaves_everything_as_it_was(tmp_path: Path) -> None:
    def broken() -> Iterator[ScenarioDescription]:
        yield make_scenario(2)
        raise RuntimeError("the disk is on fire")

    export([make_scenario(1)], tmp_path / "db")
    for name in ("db", "other"):
        with pytest.raises(RuntimeError):
            export(broken(), tmp_path / name, replace=True)
    assert [p.name for p in tmp_path.iterdir()] == ["db"]
    assert [s.source.scenario_id for s in import_all(tmp_path / "db")] == ["s000001"]


def test_what_cannot_be_written_is_reported(tmp_path: Path) -> None:
    same = renamed(make_scenario(2), "s000001")
    report = export([make_scenario(1), same, make_scenario(3)], tmp_path / "db")
    assert report.num_scenarios == 2
    assert [error.scenario_id for error in report.refused] == ["made/v1/s000001"]
    assert "a second time" in report.refused[0].reason
    nameless = replace(make_scenario(1), dataset="scenarionet", extras={})
    with pytest.raises(InvalidScenario, match=r"extras\.dataset"):
        export([nameless], tmp_path / "none")
    with pytest.raises(BadParameter, match="no scenario to export"):
        export([], tmp_path / "none")
    assert not (tmp_path / "none").exists()


# --- there and back -----------------------------------------------------------------------------------


def assert_same(first: ScenarioDescription, second: ScenarioDescription) -> None:
    """Everything but the name, and a lane's width, which the format holds per point."""
    names = ("id", "dataset", "version", "source", "extras", "map", "split")
    for name in set(first.__dataclass_fields__) - set(names):
        assert differences(getattr(first, name), getattr(second, name), name) == []
    for name in ("scenario_id", "licence", "log", "city", "date", "crs"):
        assert getattr(first.source, name) == getattr(second.source, name)
    assert (first.map is None) == (second.map is None)
    if first.map is not None:
        lists = [
            np.broadcast_to(w, (len(p), 2)) if len(w) else w
            for w, p in zip(first.map.width, first.map.polyline, strict=True)
        ]
        wide = replace(first.map, width=Ragged.from_lists(lists, width=2))
        assert differences(wide, second.map, "map") == []


@given(
    seed=st.integers(0, 10_000),
    num_objects=st.integers(2, 12),
    num_steps=st.integers(2, 40),
    num_lights=st.integers(0, 3),
    has_z=st.booleans(),
    has_map=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_export_and_import_give_the_same_arrays(
    tmp_path_factory, seed, num_objects, num_steps, num_lights, has_z, has_map
):
    scenario = make_scenario(
        seed, num_objects=num_objects, num_steps=num_steps, num_lights=num_lights, has_z=has_z, has_map=has_map
    )
    (again,) = import_all(export([scenario], tmp_path_factory.mktemp("round") / "db").directory)
    again.validate()
    assert_same(scenario, again)
    assert again.id == f"scenarionet/v1/made_s{seed:06d}"
    assert again.extras == {**scenario.extras, "dataset": "made", "version": "v1", "id": f"s{seed:06d}"}


def test_nuscenes_comes_back_with_its_true_ego(tmp_path: Path) -> None:
    scenario = make_scenario(2, dataset="nuscenes", version="v1.0-mini")
    (again,) = import_all(export([scenario], tmp_path / "db").directory)
    assert_same(scenario, again)


@pytest.mark.parametrize("source", ["made", "recorded"])
def test_imported_pickles_survive_another_round(source: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if source == "made":
        raw = made.write_vintages(tmp_path / "raw")
    else:
        raw = request.getfixturevalue("recordings") / "scenarionet"
    first = {scenario.id: scenario for scenario in import_all(raw)}
    report = export(first.values(), tmp_path / "db")
    assert not report.refused
    second = {scenario.id: scenario for scenario in import_all(report.directory)}
    assert second.keys() == first.keys()
    for scenario_id, scenario in first.items():
        assert_same(scenario, second[scenario_id])
        assert second[scenario_id].extras == scenario.extras
        assert scenario.map.types.tolist() == second[scenario_id].map.types.tolist()
        assert MapFeatureType.LANE_SURFACE_STREET in scenario.map.types
