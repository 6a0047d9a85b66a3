"""Pickles of every vintage become the same scenario; pickles that run code become none."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import converters
from scenarionet_data.converters.base import Options
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.converters.stretches import to_records
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.scenario import ScenarioDescription
from scenarionet_data.testing import ConverterConformance, differences
from scenarionet_data.vocabulary import LightState, MapFeatureType, ObjectType
from tests.fixtures import scenarionet_pickles as made

CONVERTER = ScenarioNetPickles()
VINTAGES = {
    "waymo": made.waymo,
    "waymo_old": made.waymo_old,
    "nuscenes": made.nuscenes,
    "av2": made.argoverse2,
    "nuplan": made.nuplan,
    "metadrive": lambda _: made.metadrive(3),
    "centralised": lambda name: made.centralised(made.waymo(name)),
}
FLAT = ("av2", "nuplan")


class TestVintages(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "sd_*.pkl"

    @pytest.fixture
    def raw(self, tmp_path: Path) -> Path:
        return made.write_vintages(tmp_path / "vintages")


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "sd_*.pkl"

    @pytest.fixture
    def raw(self, recordings: Path) -> Path:
        return recordings / "scenarionet"

    def test_every_recording_is_read(self, raw: Path) -> None:
        scenarios = {scenario.id: scenario for scenario in self.scenarios(raw)}
        assert len(scenarios) == 14
        busy = scenarios["scenarionet/v1/nuscenes_scene-0061"]
        assert (busy.num_timesteps, len(busy.tracks), len(busy.map)) == (191, 226, 586)
        assert busy.tracks.size[busy.ego_index, 0] == pytest.approx([4.08, 1.73, 1.56])
        assert not busy.map.polyline.values[:, 2].any()
        assert {len(s.lights) for i, s in scenarios.items() if "waymo" in i} == {8, 14, 19}
        assert scenarios["scenarionet/v1/waymo_eb4b91b10ca94ff2"].objects_of_interest == ("11", "17")


def convert(description: made.Description, folder: Path) -> ScenarioDescription:
    path = made.write_pickle(description, folder / "sd_made.pkl")
    (shard,) = CONVERTER.shards(str(folder), "train", "v1", Options())
    (record,) = CONVERTER.records(shard)
    assert path.name == record.name
    scenario = CONVERTER.scenario(shard, record)
    scenario.validate()
    return scenario


def list_items(raw: Path) -> set[str]:
    return {item.name for shard in CONVERTER.shards(str(raw), "train", "v1", Options()) for item in shard.items}


# --- what was driven is the same in every vintage -----------------------------------------------------


@pytest.mark.parametrize("vintage", VINTAGES)
def test_vintages_agree_on_the_drive(vintage: str, tmp_path: Path) -> None:
    truth = convert(made.waymo("x"), tmp_path / "truth")
    scenario = convert(VINTAGES[vintage]("x"), tmp_path / "vintage")
    axes = 2 if vintage in FLAT else 3
    # A nuScenes ego stands on the ground; nuPlan's source frame is lost with the ego's first position.
    first = made.ORIGIN[:axes] if vintage == "nuplan" else 0
    ours, theirs = (s.origin + s.tracks.position.astype(np.float64) for s in (scenario, truth))
    others = slice(1, None)
    assert np.array_equal(scenario.tracks.valid, truth.tracks.valid)
    valid = truth.tracks.valid[others]
    assert (ours[others][valid][:, :axes] + first) == pytest.approx(theirs[others][valid][:, :axes], abs=2e-3)
    assert (ours[0, :, :2] + (first if vintage != "nuplan" else first[:2])) == pytest.approx(theirs[0, :, :2], abs=2e-3)
    for name in ("object_type", "heading", "velocity"):
        assert getattr(scenario.tracks, name) == pytest.approx(getattr(truth.tracks, name), abs=1e-5)
    assert scenario.tracks.size[:4] == pytest.approx(truth.tracks.size[:4])
    assert scenario.tracks.size[0, 0] == pytest.approx(made.EGO_SIZE)
    assert scenario.timestamps == pytest.approx(np.arange(41) * 0.1, abs=1e-6)
    assert scenario.dt == pytest.approx(0.1)
    assert scenario.has_z == (vintage not in FLAT)


def test_moved_by_metadrive_comes_back(tmp_path: Path) -> None:
    still = convert(made.waymo("x"), tmp_path / "still")
    moved = convert(made.centralised(made.waymo("x")), tmp_path / "moved")
    assert moved.origin.tolist() == still.origin.tolist()
    assert moved.map.polyline.values == pytest.approx(still.map.polyline.values, abs=2e-3)
    assert moved.lights.stop_point == pytest.approx(still.lights.stop_point, abs=2e-3)


# --- what each vintage says beyond that ---------------------------------------------------------------


def test_names_of_the_pickle_are_kept(tmp_path: Path) -> None:
    scenario = convert(made.nuplan("d1"), tmp_path)
    assert scenario.id == "scenarionet/v1/nuplan_d1"
    assert (scenario.dataset, scenario.version, scenario.split) == ("scenarionet", "v1", "train")
    assert scenario.extras["dataset"] == "nuplan"
    assert scenario.extras["version"] == "nuplan_v1.1"
    assert scenario.extras["metadata"]["scenario_type"] == "stationary"
    source = scenario.source
    assert (source.scenario_id, source.file, source.city) == ("d1", "sd_made.pkl", "us-nv-las-vegas-strip")
    assert (source.log, source.licence) == ("2021.06.14.13.27.42_veh-35_00001", "CC BY-NC-SA 4.0")


def test_what_is_not_stored_is_counted(tmp_path: Path) -> None:
    assert convert(made.metadrive(3), tmp_path / "pg").extras["unstored"] == {
        "states": {"action": 2, "steering": 2},
        "metadata": ["agent_to_object"],
    }
    assert convert(made.nuplan("d1"), tmp_path / "nuplan").extras["unstored"] == {
        "map_features": {"SOMETHING_NEW": 1},
        "metadata": ["scenario_extraction_info"],
    }


def test_assumed_and_estimated_values_are_marked(tmp_path: Path) -> None:
    tracks = {name: convert(VINTAGES[name]("x"), tmp_path / name).tracks for name in VINTAGES}
    assert tracks["metadrive"].is_size_assumed.tolist() == [False] * 4 + [True] * 2
    assert tracks["metadrive"].size[4, 0] == pytest.approx([0.4, 0.4, 0.8])
    assert tracks["av2"].is_size_assumed.all()
    assert tracks["nuscenes"].is_velocity_estimated.all()
    assert not tracks["waymo"].is_size_assumed.any() and not tracks["waymo"].is_velocity_estimated.any()
    assert tracks["nuscenes"].source_type.tolist() == ["vehicle.car"] * 6
    assert tracks["waymo"].source_type.tolist() == [None] * 6


def test_invented_speed_limits_are_dropped(tmp_path: Path) -> None:
    limits = {
        "waymo": [40.2336 / 3.6] * 3 + [np.nan] * 6,
        "nuscenes": [np.nan] * 4,
        "av2": [np.nan],
        "nuplan": [13.4, np.nan, np.nan],
        "metadrive": [np.nan, 60 / 3.6, np.nan],
    }
    for name, wanted in limits.items():
        found = convert(VINTAGES[name]("x"), tmp_path / name).map.speed_limit
        assert found == pytest.approx(np.array(wanted), nan_ok=True), name


def test_waymo_map(tmp_path: Path) -> None:
    features = convert(made.waymo("x"), tmp_path).map
    row = {str(i): n for n, i in enumerate(features.ids)}
    assert features.exit_lanes[row["1"]].tolist() == ["3"]
    assert features.exit_lanes[row["3"]].tolist() == ["99"]
    assert features.left_neighbors[row["1"]].tolist() == ["2"]
    assert features.left_boundaries[row["1"]].tolist() == ["21"]
    assert features.width.lengths.tolist() == [21, 21, 21, 0, 0, 0, 0, 0, 0]
    details = to_records(json.loads(features.extras[row["1"]]))
    assert details["left_neighbor"][0]["boundaries"][0]["boundary_feature_id"] == "21"
    assert features.controlled_lanes[row["32"]].tolist() == ["1", "2"]
    assert features.polyline[row["32"]].shape == (1, 3)
    assert features.polyline[row["23"]].shape == (1, 3)
    assert features.types[row["31"]] == MapFeatureType.CROSSWALK


def test_nuscenes_lane_headings_are_no_heights(tmp_path: Path) -> None:
    scenario = convert(made.nuscenes("x"), tmp_path)
    assert scenario.has_z
    heights = scenario.origin[2] + scenario.map.polyline.values[:, 2]
    assert not heights.any()
    assert scenario.tracks.position[1, 0, 2] == pytest.approx(-24 + 1.5)


def test_argoverse_widths_of_zero_are_unknown(tmp_path: Path) -> None:
    assert convert(made.argoverse2("x"), tmp_path).map.width.lengths.tolist() == [0]


@pytest.mark.parametrize(("width", "found"), [(None, []), (0, []), ([1.5, 2.0], [[1.5, 2.0]]), ([], [])])
def test_widths_of_other_forms(width: object, found: list[object], tmp_path: Path) -> None:
    description = made.argoverse2("x")
    for feature in description["map_features"].values():
        feature["width"] = width
    assert convert(description, tmp_path).map.width[0].tolist() == found


def test_lights(tmp_path: Path) -> None:
    lights = convert(made.waymo("x"), tmp_path / "waymo").lights
    assert (lights.ids.tolist(), lights.lane_ids.tolist(), lights.is_lane_in_map.tolist()) == (["3"], ["3"], [True])
    assert [LightState(code).name for code in lights.state[0, [0, 20, 30]]] == [
        "LANE_STATE_STOP",
        "ABSENT",
        "LANE_STATE_GO",
    ]
    planar = convert(made.nuplan("x"), tmp_path / "nuplan").lights
    assert planar.stop_point.tolist() == [[20.0, 1.0, 0.0]]


def test_oldest_lights_have_a_stop_point_per_step(tmp_path: Path) -> None:
    description = made.waymo("x")
    light = description["dynamic_map_states"]["3"]
    points = np.zeros((41, 3))
    points[5:] = light.pop("stop_point")
    light["state"] |= {"stop_point": points, "lane": (np.arange(41) >= 5) * 3}
    scenario = convert(description, tmp_path)
    assert scenario.origin + scenario.lights.stop_point[0] == pytest.approx(
        made.ORIGIN + np.array([45, 0, 0]), abs=2e-3
    )


def test_challenge_tracks_and_time(tmp_path: Path) -> None:
    scenario = convert(made.waymo_old("x"), tmp_path)
    assert scenario.tracks_to_predict == (("11", 2),)
    assert scenario.objects_of_interest == ("11",)
    assert (scenario.current_timestep, scenario.ego_id) == (10, "10")


def test_unknown_track_type_is_other(tmp_path: Path) -> None:
    description = made.waymo("x")
    description["tracks"]["15"]["type"] = "HOVERCRAFT"
    description["tracks"]["15"]["metadata"]["type"] = "hover.craft"
    tracks = convert(description, tmp_path).tracks
    assert tracks.object_type[4] == ObjectType.OTHER
    assert tracks.source_type[4] == "hover.craft"


# --- folders ------------------------------------------------------------------------------------------


def test_nested_folders_and_file_names(tmp_path: Path) -> None:
    raw = made.write_vintages(tmp_path)
    made.write_pickle({}, raw / "notes.pkl")
    assert list_items(raw) == {
        "waymo_0/sd_waymo_v1.2_a1.pkl",
        "waymo_0/sd_waymo_v1.2_a2.pkl",
        "old/sd_training.tfrecord-0_b1.pkl",
        "nu/0.pkl",
        "nu/1.pkl",
        "av2/sd_av2_v2_c1.pkl",
        "nuplan/sd_nuplan_v1.1_d1.pkl",
        "pg/deep/sd_pg_MetaDrive v0.4.3_PGMap-7.pkl",
        "moved/sd_waymo_v1.2_e1.pkl",
    }
    assert list_items(raw / "nu" / "0.pkl") == {"0.pkl"}


def test_a_mapping_is_followed_and_decides(tmp_path: Path) -> None:
    made.write_vintages(tmp_path)
    virtual = tmp_path / "chosen"
    made.write_pickle({"sd_waymo_v1.2_a2.pkl": "../waymo_0", "1.pkl": "../nu"}, virtual / "dataset_mapping.pkl")
    made.write_pickle(made.waymo("z"), virtual / "sd_left_out.pkl")
    assert list_items(virtual) == {"../waymo_0/sd_waymo_v1.2_a2.pkl", "../nu/1.pkl"}
    (shard,) = CONVERTER.shards(str(virtual), "train", "v1", Options())
    assert {CONVERTER.scenario(shard, r).id for r in CONVERTER.records(shard)} == {
        "scenarionet/v1/waymo_a2",
        "scenarionet/v1/nuscenes_scene-0002",
    }


def test_wrong_folders_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(SourceNotFound, match="give the folder with ScenarioNet pickles"):
        list_items(tmp_path / "nowhere")
    made.write_pickle({}, tmp_path / "other" / "notes.pkl")
    with pytest.raises(SourceNotFound, match=r"sd_\*\.pkl"):
        list_items(tmp_path / "other")
    made.write_pickle({"sd_gone.pkl": ""}, tmp_path / "virtual" / "dataset_mapping.pkl")
    with pytest.raises(SourceNotFound, match=r"sd_gone\.pkl"):
        list_items(tmp_path / "virtual")
    (tmp_path / "virtual" / "dataset_mapping.pkl").write_bytes(b"")
    with pytest.raises(CorruptSource, match="remove it to take every pickle"):
        list_items(tmp_path / "virtual")


def test_a_moved_folder_gives_the_same_shards(tmp_path: Path) -> None:
    made.write_vintages(tmp_path / "first")
    shutil.copytree(tmp_path / "first", tmp_path / "second")
    keys = [
        [s.key("1") for s in CONVERTER.shards(str(tmp_path / n), "train", "v1", Options())] for n in ("first", "second")
    ]
    assert keys[0] == keys[1]


def test_the_registry_knows_it() -> None:
    assert isinstance(converters.get("scenarionet"), ScenarioNetPickles)


# --- what is refused ----------------------------------------------------------------------------------


class Malicious:
    """Runs a command when it is unpickled."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return os.system, (f"touch {self.marker}",)


@pytest.mark.parametrize("protocol", range(6))
def test_a_pickle_that_runs_code_is_refused(protocol: int, tmp_path: Path) -> None:
    marker = tmp_path / "ran"
    description = made.waymo("x")
    description["metadata"]["source_file"] = Malicious(marker)
    path = made.write_pickle(description, tmp_path / "sd_evil.pkl", protocol)
    with pytest.raises(InvalidScenario, match=r"wanted arrays and builtins, found posix\.system"):
        load(path, "sd_evil.pkl")
    assert not marker.exists()


@pytest.mark.parametrize("name", ["builtins eval", "builtins getattr", "numpy load", "numpy.core.multiarray fromfile"])
def test_functions_of_allowed_modules_are_refused(name: str, tmp_path: Path) -> None:
    module, _, function = name.partition(" ")
    path = tmp_path / "sd_evil.pkl"
    path.write_bytes(b"c" + module.encode() + b"\n" + function.encode() + b"\n(S'1'\ntR.")
    with pytest.raises(InvalidScenario, match=f"found {module}.{function}"):
        load(path, "evil")


class Forged:
    """A call of numpy's own, with arguments that numpy would trust."""

    def __init__(self, *call: object) -> None:
        self.call = call

    def __reduce__(self):
        return self.call


FORGERIES = {
    "objects at addresses of the pickle's choice": Forged(np.ndarray, ((1,), np.dtype(object), b"A" * 8)),
    "a dtype with fields": np.zeros(1, [("a", object)]),
    "a dtype that claims to have no objects": Forged(
        np.dtype, ("V8", False, True), (3, "|", None, ("a",), {"a": (np.dtype(object), 0)}, 8, 1, 0)
    ),
    "raw bytes for objects": Forged(
        np.ndarray, ((0,), np.dtype("i1")), (1, (1,), np.dtype(object), False, b"A" * 8)
    ),
    "fewer bytes than values": Forged(
        np.ndarray, ((0,), np.dtype("i1")), (1, (9,), np.dtype("f8"), False, b"A" * 8)
    ),
}  # fmt: skip


@pytest.mark.parametrize("forgery", FORGERIES)
@pytest.mark.parametrize("protocol", range(6))
def test_forged_arrays_do_no_harm(forgery: str, protocol: int, tmp_path: Path) -> None:
    path = made.write_pickle({"a": FORGERIES[forgery]}, tmp_path / "sd_evil.pkl", protocol)
    try:
        (found,) = load(path, "evil").values()
    except InvalidScenario:
        return
    assert forgery.startswith("objects at") and found.shape == (0,)


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("core", ["numpy.core", "numpy._core"])
def test_names_of_numpy_1_and_2_are_read(protocol: int, core: str, tmp_path: Path) -> None:
    value = {"a": np.arange(6.0).reshape(2, 3), "b": np.float32(1.5), "c": np.array(["x", None], dtype=object)}
    data = pickle.dumps(value, protocol)
    current = f"{np.zeros(0).__reduce__()[0].__module__.rpartition('.')[0]}".encode()
    if protocol >= 4:  # names carry their length
        for module in (b".multiarray", b".numeric"):
            old, new = current + module, core.encode() + module
            data = data.replace(bytes([len(old)]) + old, bytes([len(new)]) + new)
        data = data[:2] + data[11:]  # without the frame, whose length has changed
    else:
        data = data.replace(current + b".", core.encode() + b".")
    path = tmp_path / "sd_x.pkl"
    path.write_bytes(data)
    found = load(path, "x")
    assert found["a"].tolist() == value["a"].tolist()
    assert found["b"] == value["b"] and found["c"].tolist() == ["x", None]


DAMAGES = {
    "tracks": lambda d: d.pop("tracks"),
    "metadata": lambda d: d.pop("metadata"),
    "pickle": lambda d: d["metadata"].pop("sdc_id"),
    "tracks['11'].state.velocity": lambda d: d["tracks"]["11"]["state"].pop("velocity"),
    "tracks['11'].state.position": lambda d: d["tracks"]["11"]["state"].update(position=np.zeros((40, 3))),
    "tracks['11'].state.heading": lambda d: d["tracks"]["11"]["state"].update(heading=np.zeros((41, 2))),
    "dynamic_map_states['3'].state.object_state": lambda d: d["dynamic_map_states"]["3"]["state"].update(
        object_state=["PURPLE"] * 41
    ),
}


@pytest.mark.parametrize("field", DAMAGES)
def test_a_damaged_description_is_named(field: str, tmp_path: Path) -> None:
    description = made.waymo("x")
    DAMAGES[field](description)
    with pytest.raises(InvalidScenario) as error:
        convert(description, tmp_path)
    assert error.value.field == field
    assert error.value.scenario_id == "sd_made.pkl"


def test_no_tracks_and_no_dictionary(tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match="wanted at least the ego"):
        convert(made.waymo("x") | {"tracks": {}}, tmp_path / "empty")
    with pytest.raises(InvalidScenario, match="wanted a dictionary, found list"):
        convert([1, 2], tmp_path / "list")


def test_lights_of_wrong_length_are_refused(tmp_path: Path) -> None:
    description = made.waymo("x")
    description["dynamic_map_states"]["3"]["state"]["object_state"].pop()
    with pytest.raises(InvalidScenario, match="wanted 41 states, found 40"):
        convert(description, tmp_path)


def test_subclassed_dictionaries_are_read(tmp_path: Path) -> None:
    """MetaDrive's class, pickled as it is: only its name stands in the pickle, its code is not needed."""
    plain = pickle.dumps(made.waymo("x"), 2)
    name = b"cmetadrive.scenario.scenario_description\nScenarioDescription\n)\x81"
    path = tmp_path / "a" / "sd_made.pkl"
    path.parent.mkdir()
    path.write_bytes(plain[:2] + name + plain[3:])  # instead of EMPTY_DICT
    first = CONVERTER.scenario(*_only(path.parent))
    assert differences(first.tracks, convert(made.waymo("x"), tmp_path / "b").tracks) == []


def _only(folder: Path):
    (shard,) = CONVERTER.shards(str(folder), "train", "v1", Options())
    return shard, shard.items[0]
