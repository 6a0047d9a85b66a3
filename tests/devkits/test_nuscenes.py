"""The nuScenes converter agrees with what nuscenes-devkit reads from the same dataroot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from scenarionet_data.converters.nuscenes import NuScenes
from scenarionet_data.converters.nuscenes.map_features import read_map
from scenarionet_data.scenario.vocabulary import MapFeatureType
from tests.devkits.environments import read_with
from tests.fixtures import nuscenes as fixture
from tests.fixtures.nuscenes_recorded import read_pickles, write_recorded
from tests.fixtures.reading import scenarios

pytestmark = pytest.mark.devkits
CONVERTER = NuScenes()
Read = tuple[Path, dict[str, Any]]


@pytest.fixture(scope="module", params=["invented", "recorded"])
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Read:
    """A dataroot with the devkit's reading of it."""
    root = tmp_path_factory.mktemp("nuscenes")
    if request.param == "invented":
        scenes = fixture.write_invented(root, num_scenes=2)
    else:
        scenes = write_recorded(root, read_pickles(request.getfixturevalue("recordings")))
    path = root / "maps" / "prediction" / "prediction_scenes.json"
    path.parent.mkdir()
    path.write_text(json.dumps({scene.name: _asked(scene) for scene in scenes}))
    return root, read_with("nuscenes", "nuscenes_reads.py", root, "v1.0-mini")


def _asked(scene: fixture.Scene) -> list[str]:
    """Challenge entries in the official file's format, for the first objects visible at the fifth keyframe."""
    seen = [thing.token for thing in scene.things if thing.seen[4]][:3]
    return [f"{token}_{scene.samples[4]}" for token in seen]


def test_boxes_and_poses(read: Read) -> None:
    root, devkit = read
    made = scenarios(CONVERTER, root, "mini")
    assert {s.source.scenario_id for s in made} == set(devkit["scenes"])
    for scenario in made:
        scene, tracks = devkit["scenes"][scenario.source.scenario_id], scenario.tracks
        assert scene["location"] == scenario.source.city
        assert [sample["token"] for sample in scene["samples"]] == scenario.extras["sample_tokens"]
        steps = scenario.extras["keyframe_timesteps"]
        assert tracks.valid[:-1, steps].sum() == sum(len(sample["boxes"]) for sample in scene["samples"])
        for step, sample in zip(steps, scene["samples"], strict=True):
            moment = (sample["timestamp"] - scene["samples"][0]["timestamp"]) * 1e-6
            assert scenario.timestamps[step] == pytest.approx(moment, abs=1e-6)
            ego = tracks.position[scenario.ego_index, step, :2] + scenario.origin[:2]
            assert np.hypot(*(ego - sample["ego"][:2])) == pytest.approx(1.385, abs=1e-3)
            for token, box in sample["boxes"].items():
                k = tracks.index(token)
                assert tracks.valid[k, step]
                assert np.abs(tracks.position[k, step] + scenario.origin - box["center"]).max() < 1e-4
                turn = (tracks.heading[k, step] - box["yaw"] + np.pi) % (2 * np.pi) - np.pi
                assert abs(turn) < 2e-6
                width, length, height = box["wlh"]
                np.testing.assert_allclose(tracks.size[k, step], [length, width, height], atol=1e-4)
                assert tracks.source_type[k] == box["name"]
                # The devkit's central difference over keyframes; NaN for an object that is seen once. Over a gap
                # in a track the devkit continues, ours does not.
                if np.diff(np.flatnonzero(tracks.valid[k])).max(initial=1) == 1:
                    wanted = np.nan_to_num(box["velocity"])
                    np.testing.assert_allclose(tracks.velocity[k, step], wanted, atol=1e-3)


def test_lanes_and_their_links(read: Read) -> None:
    root, devkit = read
    for location, expansion in devkit["maps"].items():
        features = read_map(root / "maps" / "expansion" / f"{location}.json").build(np.zeros(3))
        rows = {name: k for k, name in enumerate(features.ids)}
        assert expansion["lanes"]
        for token, poses in expansion["lanes"].items():
            k, points = rows[token], np.array(poses)[:, :2]
            # The devkit repeats the points where two paths of a lane join.
            step = np.hypot(*np.diff(points, axis=0, prepend=np.inf).T)
            np.testing.assert_allclose(features.polyline[k][:, :2], points[step > 0.01], atol=1e-3)
            assert set(expansion["outgoing"][token]) <= set(features.exit_lanes[k])
            assert set(expansion["incoming"][token]) <= set(features.entry_lanes[k])
            # Additional links are stated from the other side.
            for other in set(features.exit_lanes[k]) - set(expansion["outgoing"][token]):
                assert token in expansion["incoming"][other]
            for other in set(features.entry_lanes[k]) - set(expansion["incoming"][token]):
                assert token in expansion["outgoing"][other]
        parts = [
            features.polygon[k][:, :2] for k in np.flatnonzero(features.feature_type == MapFeatureType.DRIVABLE_AREA)
        ]
        area = sum(shapely.Polygon(part).area for part in parts)
        assert area == pytest.approx(sum(expansion["drivable"]), rel=1e-4)
        for token, kind in expansion["stop_lines"].items():
            assert json.loads(features.extras[rows[token]])["stop_line_type"] == kind


@pytest.mark.parametrize("split", ["mini_train", "mini_val"])
def test_predictions_of_the_challenge(read: Read, split: str) -> None:
    root, devkit = read
    found = []
    for scenario in scenarios(CONVERTER, root, split, by="window"):
        now = scenario.extras["keyframe_timesteps"].index(scenario.current_timestep)
        sample = scenario.extras["sample_tokens"][now]
        found += [f"{token}_{sample}" for token, _ in scenario.tracks_to_predict]
    assert sorted(found) == sorted(devkit["challenge"][split])
    assert found
