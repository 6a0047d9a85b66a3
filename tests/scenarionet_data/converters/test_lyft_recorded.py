"""Reference values of the recorded Lyft data, which comes without the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.lyft import Lyft
from scenarionet_data.converters.lyft.recording import LyftContent, LyftRecording
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, ObjectType
from tests.fixtures.reading import scenarios


@pytest.fixture(scope="module")
def content(recordings: Path) -> LyftContent:
    """All frames."""
    return LyftRecording(recordings / "lyft" / "scenes" / "sample.zarr").read(0, 248, "sample")


@pytest.fixture(scope="module")
def whole(recordings: Path) -> ScenarioDescription:
    """The whole scene as one scenario."""
    (scenario,) = scenarios(Lyft(), recordings / "lyft", has_map=False, window=25.0)
    return scenario


def test_recorded_rows(content: LyftContent) -> None:
    assert len(content.times) == 248
    assert len(content.agents) == 20_802
    assert len(np.unique(content.agents["track_id"])) == 1_653
    assert len(content.faces) == 3_216
    assert (content.faces["traffic_light_face_status"][:, 0] > 0).sum() == 670
    assert (content.times[-1] - content.times[0]) * 1e-9 == pytest.approx(24.699, abs=1e-3)
    labels = np.bincount(content.agents["label_probabilities"].argmax(axis=1), minlength=17)
    assert {k: int(n) for k, n in enumerate(labels) if n} == {1: 14_666, 3: 5_749, 12: 78, 14: 309}


def test_recorded_scene(whole: ScenarioDescription) -> None:
    assert whole.id == "lyft/v1.0/host-a101-1571846863319362048@1571846881502692276"
    assert whole.num_timesteps == 248
    assert len(whole.tracks) == 1_653 + 1
    assert whole.tracks.valid[:-1].sum() == 20_802
    assert whole.source.date == "2019-10-23T16:08:01"
    np.testing.assert_allclose(np.diff(whole.timestamps), 0.1, atol=1e-3)


def test_recorded_values_match_the_file(whole: ScenarioDescription, content: LyftContent) -> None:
    tracks = whole.tracks
    row = {track: number for number, track in enumerate(tracks.ids)}
    rows = [row[str(track)] for track in content.agents["track_id"]]
    found = tracks.position[rows, content.frame, :2].astype(np.float64) + whole.origin[:2]
    assert np.abs(found - content.agents["centroid"]).max() < 1e-4
    turn = tracks.heading[rows, content.frame] - content.agents["yaw"]
    assert np.abs((turn + np.pi) % (2 * np.pi) - np.pi).max() < 2e-6
    recorded = content.agents["velocity"]
    is_kept = recorded.any(axis=1)
    assert np.abs(tracks.velocity[rows, content.frame][is_kept] - recorded[is_kept]).max() < 1e-4
    np.testing.assert_allclose(tracks.size[rows, content.frame], content.agents["extent"], atol=1e-4)


def test_recorded_zero_velocities(whole: ScenarioDescription, content: LyftContent) -> None:
    """Three quarters of the rows have zero velocity; a few of them belong to moving road users."""
    assert (~content.agents["velocity"].any(axis=1)).mean() == pytest.approx(0.73, abs=0.01)
    tracks, count = whole.tracks, whole.extras["num_repaired_velocities"]
    assert 300 < count < 500
    kinds = set(tracks.object_type[tracks.is_velocity_estimated].tolist())
    assert kinds <= {ObjectType.VEHICLE, ObjectType.CYCLIST, ObjectType.PEDESTRIAN, ObjectType.OTHER}
    unknown = tracks.is_velocity_estimated & (tracks.object_type == ObjectType.OTHER)
    assert np.count_nonzero(unknown) == 2  # they start at 17 m/s


def test_recorded_ego_moves_along_its_heading(whole: ScenarioDescription) -> None:
    velocity, heading = (getattr(whole.tracks, name)[whole.ego_index] for name in ("velocity", "heading"))
    turn = np.arctan2(velocity[:, 1], velocity[:, 0]) - heading
    assert np.abs((turn + np.pi) % (2 * np.pi) - np.pi).max() < 0.05
    assert 6.0 < np.hypot(*velocity.T).min() < np.hypot(*velocity.T).max() < 14.0
    assert whole.tracks.source_type[whole.ego_index] == "EGO"


def test_recorded_lights(whole: ScenarioDescription, content: LyftContent) -> None:
    lights = whole.lights
    assert list(lights.ids) == sorted(set(content.faces["traffic_light_id"].tolist()))
    assert len(lights) == 6
    assert not lights.is_lane_in_map.any()
    assert set(np.unique(lights.state)) <= {LightState.ABSENT, LightState.LANE_STATE_UNKNOWN}
    seen = {(light, frame) for light, frame in zip(content.faces["traffic_light_id"], content.faces_frame, strict=True)}
    assert (lights.state != LightState.ABSENT).sum() == len(seen)
