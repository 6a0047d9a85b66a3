"""Pickles of every format generation convert to the same scenario; errors name damaged ones."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.boundary_segments import to_records
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.options import Options
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType
from scenarionet_data.testing import ConverterConformance, differences
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

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        return made.write_vintages(folder / "vintages")


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "sd_*.pkl"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recordings: Path) -> Path:
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


# --- equal drives in every format generation ----------------------------------------------------------


@pytest.mark.parametrize("vintage", VINTAGES)
def test_format_generations_agree_on_the_drive(vintage: str, tmp_path: Path) -> None:
    truth = convert(made.waymo("x"), tmp_path / "truth")
    scenario = convert(VINTAGES[vintage]("x"), tmp_path / "vintage")
    axes = 2 if vintage in FLAT else 3
    # A nuScenes ego is at ground height; nuPlan's source frame is lost with the ego's first position.
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


def test_metadrive_translation_is_undone(tmp_path: Path) -> None:
    still = convert(made.waymo("x"), tmp_path / "still")
    moved = convert(made.centralised(made.waymo("x")), tmp_path / "moved")
    assert moved.origin.tolist() == still.origin.tolist()
    assert moved.map.polyline.values == pytest.approx(still.map.polyline.values, abs=2e-3)
    assert moved.lights.stop_point == pytest.approx(still.lights.stop_point, abs=2e-3)


# --- values specific to a format generation -----------------------------------------------------------


def test_names_in_the_pickle_are_kept(tmp_path: Path) -> None:
    scenario = convert(made.nuplan("d1"), tmp_path)
    assert scenario.id == "scenarionet/v1/nuplan_d1"
    assert (scenario.dataset, scenario.version, scenario.split) == ("scenarionet", "v1", "train")
    assert scenario.extras["dataset"] == "nuplan"
    assert scenario.extras["version"] == "nuplan_v1.1"
    assert scenario.extras["metadata"]["scenario_type"] == "stationary"
    source = scenario.source
    assert (source.scenario_id, source.file, source.city) == ("d1", "sd_made.pkl", "us-nv-las-vegas-strip")
    assert (source.log, source.licence) == ("2021.06.14.13.27.42_veh-35_00001", "CC BY-NC-SA 4.0")


def test_values_without_a_column_are_kept_with_their_track_or_scenario(tmp_path: Path) -> None:
    scenario = convert(made.metadrive(3), tmp_path / "pg")
    own = json.loads(scenario.tracks.extras[0])["pickle"]
    assert set(own["state"]) == {"steering", "action"} and set(own["metadata"]) == {"spawn_info"}
    assert scenario.extras["pickle"]["layout"]["metadata"]["agent_to_object"] == {"agent": "10"}
    nuplan = convert(made.nuplan("d1"), tmp_path / "nuplan").extras["pickle"]["layout"]
    assert list(nuplan["unknown_features"]) == ["odd"]


def test_assumed_and_estimated_values_are_flagged(tmp_path: Path) -> None:
    tracks = {name: convert(VINTAGES[name]("x"), tmp_path / name).tracks for name in VINTAGES}
    assert tracks["metadrive"].is_size_assumed.tolist() == [False] * 4 + [True] * 2
    assert tracks["metadrive"].size[4, 0] == pytest.approx([0.4, 0.4, 0.8])
    assert tracks["av2"].is_size_assumed.all()
    assert tracks["nuscenes"].is_velocity_estimated.all()
    assert not tracks["waymo"].is_size_assumed.any() and not tracks["waymo"].is_velocity_estimated.any()
    others, steps = np.arange(6) != tracks["nuscenes"].ids.tolist().index("ego"), np.arange(41)
    assert (tracks["nuscenes"].is_interpolated == tracks["nuscenes"].valid & others[:, None] & (steps % 5 > 0)).all()
    assert not tracks["waymo"].is_interpolated.any()
    assert tracks["nuscenes"].source_type.tolist() == ["vehicle.car"] * 6
    assert tracks["waymo"].source_type.tolist() == [None] * 6


def test_default_speed_limits_are_dropped(tmp_path: Path) -> None:
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
    assert features.feature_type[row["31"]] == MapFeatureType.CROSSWALK


def test_nuscenes_lane_headings_are_not_read_as_heights(tmp_path: Path) -> None:
    scenario = convert(made.nuscenes("x"), tmp_path)
    assert scenario.has_z
    heights = scenario.origin[2] + scenario.map.polyline.values[:, 2]
    assert not heights.any()
    assert scenario.tracks.position[1, 0, 2] == pytest.approx(-24 + 1.5)


def test_argoverse_widths_of_zero_are_unknown(tmp_path: Path) -> None:
    assert convert(made.argoverse2("x"), tmp_path).map.width.lengths.tolist() == [0]


@pytest.mark.parametrize(("width", "found"), [(None, []), (0, []), ([1.5, 2.0], [[1.5, 2.0]]), ([], [])])
def test_widths_in_other_layouts(width: object, found: list[object], tmp_path: Path) -> None:
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


# --- invalid input ------------------------------------------------------------------------------------


DAMAGES = {
    "tracks": lambda d: d.pop("tracks"),
    "metadata": lambda d: d.pop("metadata"),
    "version": lambda d: d.update(version=None),
    "length": lambda d: d.update(length="41"),
    "pickle": lambda d: d["metadata"].pop("sdc_id"),
    "metadata.sdc_id": lambda d: d["tracks"]["10"]["state"].pop("velocity"),
    "metadata.ts": lambda d: d["metadata"].update(ts=np.zeros(41)),
}


@pytest.mark.parametrize("field", DAMAGES)
def test_damaged_description_is_named(field: str, tmp_path: Path) -> None:
    description = made.waymo("x")
    DAMAGES[field](description)
    with pytest.raises(InvalidScenario) as error:
        convert(description, tmp_path)
    assert error.value.field == field
    assert error.value.scenario_id == "sd_made.pkl"


def state_of(description: made.Description) -> dict[str, Any]:
    return description["tracks"]["11"]["state"]


BAD_MEMBERS: dict[str, tuple[Any, tuple[str, int, str, str]]] = {
    "no velocity": (lambda d: state_of(d).pop("velocity"), ("tracks", 41, "state.velocity", "is missing")),
    "short": (
        lambda d: state_of(d).update(position=np.zeros((40, 3))),
        ("tracks", 41, "state.position", "expected 41 timesteps, found an array (40, 3)"),
    ),
    "no state": (
        lambda d: d["tracks"].update({"11": 5}),
        ("tracks", 1, "form", "expected ScenarioNet's form, found a value that does not have it (TypeError)"),
    ),
    "light of unknown state": (
        lambda d: d["dynamic_map_states"]["3"]["state"].update(object_state=["PURPLE"] * 41),
        ("lights", 1, "state.object_state", "expected names of LightState or None, found 'PURPLE'"),
    ),
    "short light": (
        lambda d: d["dynamic_map_states"]["3"]["state"]["object_state"].pop(),
        ("lights", 1, "state.object_state", "expected 41 states, found 40"),
    ),
    "lane without a type": (
        lambda d: d["map_features"]["1"].pop("type"),
        ("maps", 1, "form", "expected ScenarioNet's form, found a value that does not have it (KeyError)"),
    ),
    "line of NaN": (
        lambda d: d["map_features"]["21"]["polyline"].fill(np.nan),
        ("maps", 1, "map.polyline", "wanted finite numbers, found 63 NaN or infinite of 63"),
    ),
    "line far away": (
        lambda d: d["map_features"]["21"]["polyline"].fill(1e12),
        ("maps", 1, "polyline", "expected points within 200,000 m of the ego, found one at 999,999,995,904 m"),
    ),
}


@pytest.mark.parametrize("damage", BAD_MEMBERS)
def test_bad_member_is_dropped_and_the_others_are_unchanged(damage: str, tmp_path: Path) -> None:
    change, expected = BAD_MEMBERS[damage]
    description, truth = made.waymo("x"), convert(made.waymo("x"), tmp_path / "truth")
    change(description)
    for name in ("objects_of_interest", "tracks_to_predict"):
        description["metadata"].pop(name)
    scenario = convert(description, tmp_path / "damaged")
    (defect,) = scenario.defects
    assert (defect.table, defect.count, defect.field, defect.reason) == expected
    assert (defect.file, defect.action) == ("sd_made.pkl", "dropped")
    for part in ("tracks", "lights", "map"):
        ours, theirs = getattr(scenario, part), getattr(truth, part)
        assert len(ours) == len(theirs) - (part.rstrip("s") == defect.table.rstrip("s"))
    kept = [truth.tracks.ids.tolist().index(track_id) for track_id in scenario.tracks.ids]
    assert scenario.tracks.position.tolist() == truth.tracks.position[kept].tolist()


BAD_STATES = {
    "position": lambda state: state["position"].__setitem__((5, 0), np.nan),
    "heading": lambda state: state["heading"].__setitem__(5, np.inf),
    "velocity": lambda state: state["velocity"].__setitem__((5, 1), 1e9),
    "size": lambda state: state["length"].__setitem__(5, 1e9),
}


@pytest.mark.parametrize("field", BAD_STATES)
def test_bad_state_is_dropped_and_the_others_are_unchanged(field: str, tmp_path: Path) -> None:
    description, truth = made.waymo("x"), convert(made.waymo("x"), tmp_path / "truth")
    BAD_STATES[field](state_of(description))
    scenario = convert(description, tmp_path / "damaged")
    (defect,) = scenario.defects
    assert (defect.table, defect.location, defect.field, defect.count) == ("tracks", "track 11 at step 5", field, 1)
    wanted = truth.tracks.valid.copy()
    wanted[1, 5] = False
    assert (scenario.tracks.valid == wanted).all()
    assert scenario.tracks.position.tolist() == np.where(wanted[..., None], truth.tracks.position, 0).tolist()


def test_references_to_dropped_tracks_are_dropped(tmp_path: Path) -> None:
    description = made.waymo("x")
    del description["tracks"]["11"]["state"]
    scenario = convert(description, tmp_path)
    assert (scenario.objects_of_interest, scenario.tracks_to_predict) == ((), ())
    assert [defect.field for defect in scenario.defects] == ["form", "objects_of_interest", "tracks_to_predict"]


def test_empty_tracks_and_non_dictionaries_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match="expected at least the ego"):
        convert(made.waymo("x") | {"tracks": {}}, tmp_path / "empty")
    with pytest.raises(InvalidScenario, match="expected a dictionary, found list"):
        convert([1, 2], tmp_path / "list")


def test_subclassed_dictionaries_are_read(tmp_path: Path) -> None:
    """MetaDrive's subclass is referenced by name only; its code is not needed."""
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
