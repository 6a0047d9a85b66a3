"""What older writers of pickles left out or wrote otherwise is repaired on reading, and written back as it was."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.export.original import to_original_dict
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState
from tests.fixtures import scenarionet_pickles as made


def converted(description: dict[str, Any], folder: Path) -> ScenarioDescription:
    path = made.write_pickle(description, folder / "sd_made.pkl")
    shard = Shard("scenarionet", "v1", "train", "s", str(folder), (RawItem(path.name, "0"),), Options())
    scenario = ScenarioNetPickles().scenario(shard, shard.items[0])
    scenario.validate()
    return scenario


def stopped(description: dict[str, Any]) -> dict[str, Any]:
    """The velocities of ScenarioNet's nuScenes converter: differences to the next position, 0 at the end."""
    for track in description["tracks"].values():
        track["state"]["velocity"][-1] = 0
    return description


def test_last_velocity_of_nuscenes_pickles_is_that_of_the_last_step(tmp_path: Path) -> None:
    description = stopped(made.nuscenes("scene-0001"))
    original = copy.deepcopy(description)
    scenario = converted(description, tmp_path)
    ego = scenario.tracks.velocity[scenario.ego_index]
    assert ego[-1].tolist() == ego[-2].tolist() == [10.0, 0.0]
    pedestrian = scenario.tracks.velocity[scenario.tracks.index("12")]
    assert pedestrian[-1].tolist() == pytest.approx([0.0, 1.4], abs=1e-4)
    assert scenario.tracks.is_velocity_estimated.all()
    written = to_original_dict(scenario)
    assert written is not None
    for name, track in original["tracks"].items():
        again, valid = written["tracks"][name]["state"]["velocity"], track["state"]["valid"] > 0.5
        np.testing.assert_allclose(again[valid], track["state"]["velocity"][valid], atol=1e-4)


def test_other_pickles_keep_velocities_that_can_be(tmp_path: Path) -> None:
    scenario = converted(stopped(made.waymo("a1")), tmp_path)
    tracks = scenario.tracks
    assert tracks.velocity[tracks.index("10"), -1].tolist() == [10.0, 0.0]
    assert not tracks.velocity[tracks.index("12"), -1].any()  # a pedestrian may stop
    assert tracks.is_velocity_estimated[[tracks.index("10"), tracks.index("12")]].tolist() == [True, False]


def test_lights_with_codes_as_states_are_kept(tmp_path: Path) -> None:
    description = made.waymo("a1")
    light = description["dynamic_map_states"]["3"]
    codes = np.array([4] * 20 + [0] * 5 + [6] * 16)
    light["state"] = {"object_state": codes, "lane": np.where(np.arange(made.LENGTH) // 5 == 4, 0, 3)}
    scenario = converted(description, tmp_path)
    assert not [each for each in scenario.defects if each.table == "lights"]
    states = [LightState.LANE_STATE_STOP] * 20 + [LightState.ABSENT] * 5 + [LightState.LANE_STATE_GO] * 16
    assert scenario.lights.state.tolist() == [states]
    written = to_original_dict(scenario)
    assert written is not None
    assert written["dynamic_map_states"]["3"]["state"]["object_state"].tolist() == codes.tolist()


def test_states_of_a_negative_size_are_dropped_and_said(tmp_path: Path) -> None:
    description = made.waymo("a1")
    description["tracks"]["11"]["state"]["length"][7] = -9.0
    scenario = converted(description, tmp_path)
    row = scenario.tracks.index("11")
    assert np.flatnonzero(~scenario.tracks.valid[row]).tolist() == [7]
    assert not scenario.tracks.is_size_assumed[row]
    assert scenario.tracks.size[row, 8].tolist() == [9.0, 2.5, 3.0]
    (defect,) = scenario.defects
    assert (defect.field, defect.action, defect.location) == ("size", "dropped", "track 11 at step 7")


@pytest.mark.parametrize(("lost", "kept"), [(3, True), (6, False)])
def test_ego_is_interpolated_over_half_a_second(tmp_path: Path, lost: int, kept: bool) -> None:
    description = made.waymo("a1")
    description["tracks"]["10"]["state"]["position"][20 : 20 + lost, 0] = np.nan
    scenario = converted(description, tmp_path)
    gap = slice(20, 20 + lost)
    ego = scenario.ego_index
    assert scenario.tracks.valid[ego, gap].tolist() == [kept] * lost
    assert scenario.tracks.is_interpolated[ego, gap].tolist() == [kept] * lost
    counts = {each.action: each.count for each in scenario.defects}
    assert counts == {"dropped": lost} | ({"assumed": lost} if kept else {})
    if kept:
        speed = np.diff(scenario.tracks.position[ego, :, 0]) / np.diff(scenario.timestamps)
        assert speed == pytest.approx(10.0, abs=0.02)


def test_form_before_scenarionet_is_named(tmp_path: Path) -> None:
    description = made.waymo("a1")
    del description["version"]
    with pytest.raises(InvalidScenario, match=r"a str named 'version', as in pickles since MetaDrive 0.3"):
        converted(description, tmp_path)
