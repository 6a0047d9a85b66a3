"""Reference values of the recorded Waymo data."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.waymo import Waymo
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType
from tests.fixtures.reading import scenarios

CONVERTER = Waymo()


@pytest.fixture(scope="module")
def recorded(recordings: Path) -> ScenarioDescription:
    (scenario,) = scenarios(CONVERTER, recordings / "waymo" / "training")
    return scenario


def test_recorded_scenario(recorded: ScenarioDescription):
    assert recorded.id == "waymo/v1.2/637f20cafde22ff8"
    assert (recorded.num_timesteps, recorded.current_timestep, recorded.ego_index) == (91, 10, 82)
    assert recorded.timestamps[:3].tolist() == [0.0, 0.10002, 0.20004]
    ids = recorded.tracks.ids
    assert recorded.tracks_to_predict == ((ids[72], 1), (ids[43], 1), (ids[42], 2))
    assert recorded.objects_of_interest == ()


def test_recorded_tracks(recorded: ScenarioDescription):
    tracks = recorded.tracks
    assert Counter(tracks.object_type.tolist()) == {1: 70, 2: 10, 3: 3}
    assert (tracks.valid.size, tracks.valid.sum()) == (7553, 4596)
    first = tracks.position[0, 0].astype(np.float64) + recorded.origin
    assert np.abs(first - [-7792.00341796875, -6685.171875, -184.56889502760163]).max() < 1e-4
    assert tracks.size[0, 0].tolist() == [np.float32(v) for v in (4.77667904, 2.06968188, 1.53438318)]


def test_recorded_lights(recorded: ScenarioDescription):
    lights = recorded.lights
    assert (len(lights), lights.is_lane_in_map.all()) == (12, True)
    counts = Counter(lights.state.ravel().tolist())
    assert counts == {
        LightState.LANE_STATE_UNKNOWN: 540,
        LightState.LANE_STATE_STOP: 324,
        LightState.LANE_STATE_ARROW_STOP: 228,
    }
    wanted = [-7811.181793532099, -6717.757387275526, -185.15017390612329]
    assert np.abs(lights.stop_point[0] + recorded.origin - wanted).max() < 1e-4


def test_recorded_map(recorded: ScenarioDescription):
    features = recorded.map
    assert features is not None
    groups = Counter(MapFeatureType(code).name.split("_")[0] for code in features.feature_type)
    assert groups == {"LANE": 199, "ROAD": 87, "STOP": 8, "CROSSWALK": 4, "SPEED": 3}
    assert len(features) == 301
    assert (len(features.polyline.values) + len(features.polygon.values)) == 19_636
    assert len(features.left_neighbors.values) + len(features.right_neighbors.values) == 382
    assert len(features.left_boundaries.values) + len(features.right_boundaries.values) == 364
    assert len(features.exit_lanes.values) + len(features.entry_lanes.values) == 386
    texts = [text for text in features.extras if text is not None]
    assert texts == [to_json(json.loads(text)) for text in texts]
    stop = features.controlled_lanes[features.ids.tolist().index("594")]
    assert stop.tolist() == ["213", "212", "211", "210"]
