"""nuScenes scenes and windows: interpolation between keyframes, the ego, types, targets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.building import METRES
from scenarionet_data.converters.nuscenes import NuScenes
from scenarionet_data.converters.nuscenes.keyframes import boxes_at, make_steps, nominal_period, poses_at
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType
from tests.fixtures import nuscenes as fixture
from tests.fixtures.reading import scenarios, shards

CONVERTER = NuScenes()
Recorded = tuple[Path, fixture.Scene, ScenarioDescription]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    root = tmp_path_factory.mktemp("nuscenes")
    (scene,) = fixture.write_invented(root, num_scenes=1)
    (scenario,) = scenarios(CONVERTER, root, "mini")
    return root, scene, scenario


def turned(angle: Any) -> np.ndarray:
    return np.abs((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)


# --- time -------------------------------------------------------------------------------------------------


def test_every_keyframe_is_a_timestep(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    assert scenario.num_timesteps == 201
    assert scenario.dt == 0.1
    assert scenario.current_timestep == 20
    assert scenario.extras["keyframe_timesteps"] == list(range(0, 201, 5))
    assert scenario.extras["sample_tokens"] == scene.samples
    seconds = (scene.times - scene.times[0]) * 1e-6
    np.testing.assert_allclose(scenario.timestamps[::5], seconds, atol=1e-9)
    step = np.diff(scenario.timestamps)
    assert step.min() > 0.07
    assert step.max() < 0.13
    np.testing.assert_allclose(step.reshape(-1, 5), np.repeat(np.diff(seconds)[:, None] / 5, 5, axis=1), atol=1e-9)


def test_recorded_frames_are_the_keyframes(recorded: Recorded) -> None:
    """Their times and states equal the raw ones, and nothing is interpolated."""
    root, scene, whole = recorded
    (scenario,) = scenarios(CONVERTER, root, "mini", frames="recorded")
    scenario.validate()
    assert (scenario.num_timesteps, scenario.dt, scenario.current_timestep) == (41, 0.5, 4)
    assert np.array_equal(scenario.timestamps, (scene.times - scene.times[0]) * 1e-6)
    tracks = scenario.tracks
    assert not tracks.is_interpolated.any()
    for name in ("position", "heading", "size", "valid"):
        assert np.array_equal(getattr(tracks, name), getattr(whole.tracks, name)[:, ::5])
    for thing in scene.things:
        row, seen = tracks.index(thing.token), thing.seen
        assert np.array_equal(tracks.valid[row], seen)
        assert np.abs(tracks.position[row, seen] + scenario.origin - thing.boxes[seen, :3]).max() <= METRES


def test_interpolated_states_are_flagged(recorded: Recorded) -> None:
    _, _, scenario = recorded
    tracks = scenario.tracks
    at_keyframe = np.arange(scenario.num_timesteps) % 5 == 0
    objects = np.arange(len(tracks)) != scenario.ego_index  # the ego has a recorded pose at some steps in between
    assert np.array_equal(tracks.is_interpolated[objects], (tracks.valid & ~at_keyframe)[objects])
    assert not tracks.is_interpolated[:, at_keyframe].any()


def test_annotated_values_are_kept(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    tracks = scenario.tracks
    assert len(tracks) == len(scene.things) + 1
    for thing in scene.things:
        row = tracks.index(thing.token)
        seen = np.flatnonzero(thing.seen)
        assert tracks.source_type[row] == thing.category
        assert np.array_equal(tracks.valid[row, ::5], thing.seen)
        position = tracks.position[row, seen * 5].astype(np.float64) + scenario.origin
        assert np.abs(position - thing.boxes[seen, :3]).max() < 1e-4
        assert turned(tracks.heading[row, seen * 5] - thing.boxes[seen, 3]).max() < 2e-6
        np.testing.assert_allclose(tracks.size[row, seen * 5], thing.boxes[seen, 4:], atol=1e-6)
        counts = {thing.attribute: len(seen)} if thing.attribute else None
        assert (json.loads(tracks.extras[row]) if tracks.extras[row] else None) == (counts and {"attributes": counts})


def test_interpolation_is_linear_with_shortest_rotation(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    tracks, thing = (
        scenario.tracks,
        next(t for t in scene.things if t.token == fixture.token("instance", scene.name, "circling")),
    )
    row = tracks.index(thing.token)
    assert np.ptp(thing.boxes[:, 3]) > np.pi  # it passes from pi to -pi
    for k in range(len(scene.times) - 1):
        for part in range(5):
            wanted = thing.boxes[k] + part / 5 * (thing.boxes[k + 1] - thing.boxes[k])
            step = 5 * k + part
            assert np.abs(tracks.position[row, step] + scenario.origin - wanted[:3]).max() < 1e-4
            assert turned(tracks.heading[row, step] - wanted[3]) < 2e-6


def test_gaps_are_kept(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    tracks = scenario.tracks
    spans = {"gap": [(0, 95), (110, 200)], "late": [(15, 190)], "once": [(100, 100)]}
    for kind, wanted in spans.items():
        valid = tracks.valid[tracks.index(fixture.token("instance", scene.name, kind))]
        edges = np.flatnonzero(np.diff(np.concatenate([[0], valid, [0]]))).reshape(-1, 2)
        assert [(first, last - 1) for first, last in edges.tolist()] == wanted
    once = tracks.index(fixture.token("instance", scene.name, "once"))
    assert not tracks.velocity[once].any()


def test_missing_keyframe_is_not_interpolated() -> None:
    """A missing sample leaves a second between keyframes; the steps in between stay invalid."""
    times = np.array([0.0, 0.5, 1.5, 2.0]) * 1e6
    steps = make_steps(times, nominal_period(times), 10)
    boxes = np.zeros((1, 4, 7))
    boxes[0, :, 0] = [0.0, 1.0, 3.0, 4.0]
    found, valid = boxes_at(steps, boxes, np.ones((1, 4), bool))
    assert len(steps.times) == 21
    assert steps.at_keyframes.tolist() == [0, 5, 15, 20]
    assert valid[0].tolist() == [True] * 6 + [False] * 9 + [True] * 6
    np.testing.assert_allclose(found[0, valid[0], 0], 2e-6 * steps.times[valid[0]])
    np.testing.assert_allclose(np.diff(steps.times), 1e5)


def test_scene_with_one_keyframe(tmp_path: Path) -> None:
    scene = fixture.invented_scene("scene-0061", "Nowhere", num_keyframes=1)
    scene.things = [thing for thing in scene.things if thing.seen.any()]
    fixture.write_release(tmp_path, [scene])
    (scenario,) = scenarios(CONVERTER, tmp_path, "mini")
    scenario.validate()
    assert scenario.num_timesteps == 1
    assert scenario.tracks.valid.all()


def test_poses_are_interpolated_except_over_long_gaps() -> None:
    pose_times = np.array([0.0, 5e4, 10e4, 200e4, 205e4])
    poses = np.column_stack([pose_times / 1e4, np.zeros((5, 2)), [3.1, -3.1, -3.0, 0.0, 0.0]])
    times = np.array([-1e4, 0.0, 2.5e4, 10e4, 100e4, 200e4, 230e4])
    found, valid, is_between = poses_at(times, pose_times, poses)
    assert valid.tolist() == [True, True, True, True, False, True, False]
    assert is_between.tolist() == [True, False, True, False, True, False, True]
    np.testing.assert_allclose(found[[0, 1, 2, 3, 5, 6], 0], [0.0, 0.0, 2.5, 10.0, 200.0, 205.0])
    assert turned(found[2, 3] - np.pi) < 0.01


# --- objects ----------------------------------------------------------------------------------------------


def test_ego_box_is_ahead_of_its_axle(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    tracks, row = scenario.tracks, scenario.ego_index
    pose = scene.ego(scene.times[0] + scenario.timestamps * 1e6)
    position = tracks.position[row].astype(np.float64) + scenario.origin
    ahead = position[:, :2] - pose[:, :2]
    # Between the lidar's sweeps, 0.05 s apart, the ego goes straight.
    np.testing.assert_allclose(np.hypot(*ahead.T), 1.385, atol=2e-3)
    assert turned(np.arctan2(ahead[:, 1], ahead[:, 0]) - pose[:, 3]).max() < 2e-3
    np.testing.assert_allclose(position[:, 2], 1.562 / 2, atol=1e-4)
    length, width, height = tracks.size[row, 0].tolist()
    assert (length, width, height) == pytest.approx((4.084, 1.730, 1.562))
    assert tracks.is_size_assumed.tolist() == [False] * len(scene.things) + [True]
    assert np.hypot(*tracks.velocity[row].T).mean() == pytest.approx(8.0, abs=0.05)


def test_all_categories_have_a_type(recorded: Recorded) -> None:
    _, _, scenario = recorded
    tracks = scenario.tracks
    kinds = {w: ObjectType(c) for w, c in zip(tracks.source_type, tracks.object_type, strict=True)}
    assert set(kinds) == {*fixture.CATEGORIES, "vehicle.ego"}
    assert len(fixture.CATEGORIES) == 23
    for word, kind in kinds.items():
        if word in ("vehicle.bicycle", "vehicle.motorcycle"):
            assert kind is ObjectType.CYCLIST
        elif word in ("movable_object.barrier", "movable_object.trafficcone"):
            assert kind.name == {"b": "TRAFFIC_BARRIER", "t": "TRAFFIC_CONE"}[word.split(".")[1][0]]
        else:
            wanted = {"vehicle": ObjectType.VEHICLE, "human": ObjectType.PEDESTRIAN}
            assert kind is wanted.get(word.split(".")[0], ObjectType.OTHER)
    assert not tracks.is_type_assumed.any()
    assert tracks.is_velocity_estimated.all()


def test_unknown_category_is_kept_and_flagged(tmp_path: Path) -> None:
    scene = fixture.invented_scene("scene-0061", "Nowhere", num_keyframes=9)
    scene.things[0].category = "vehicle.hovercraft"
    fixture.write_release(tmp_path, [scene])
    (scenario,) = scenarios(CONVERTER, tmp_path, "mini")
    tracks, row = scenario.tracks, scenario.tracks.index(scene.things[0].token)
    assert tracks.source_type[row] == "vehicle.hovercraft"
    assert tracks.object_type[row] == ObjectType.OTHER
    assert np.flatnonzero(tracks.is_type_assumed).tolist() == [row]


def test_scene_without_annotations(tmp_path: Path) -> None:
    """v1.0-test has no annotations; the scenario contains only the ego."""
    scene = fixture.invented_scene("scene-0077", "Nowhere", num_keyframes=9)
    scene.things = []
    fixture.write_release(tmp_path, [scene], release="v1.0-test")
    (scenario,) = scenarios(CONVERTER, tmp_path, "test")
    assert scenario.tracks.ids.tolist() == ["ego"]
    scenario.validate()


def test_source_metadata(recorded: Recorded) -> None:
    _, scene, scenario = recorded
    assert scenario.id == "nuscenes/v1.0/scene-0061"
    source = scenario.source
    assert (source.scenario_id, source.file, source.city) == ("scene-0061", "v1.0-mini/scene.json", scene.location)
    assert (source.log, source.date, source.crs) == (scene.logfile, "2018-07-24", "nuscenes singapore-onenorth")
    assert scenario.extras["scene_token"] == scene.token
    assert scenario.extras["start_timestamp_us"] == scene.times[0]


# --- windows ----------------------------------------------------------------------------------------------


def test_windows_of_the_challenge(recorded: Recorded, tmp_path: Path) -> None:
    root, scene, _ = recorded
    cars = {kind: fixture.token("instance", scene.name, kind) for kind in ("circling", "gap", "late")}
    asked = [("circling", 10), ("gap", 30), ("circling", 30), ("late", 3), ("circling", 38), ("circling", 10)]
    entries = [f"{cars[kind]}_{scene.samples[keyframe]}" for kind, keyframe in asked]
    path = tmp_path / "dataroot" / "maps" / "prediction" / "prediction_scenes.json"
    _linked(root, tmp_path / "dataroot")
    path.parent.mkdir()
    path.write_text(json.dumps({"scene-0061": entries, "scene-0999": ["x_y"]}))
    found = scenarios(CONVERTER, tmp_path / "dataroot", "mini", by="window")
    assert [s.id for s in found] == [f"nuscenes/v1.0/scene-0061@{scene.times[k]}" for k in (3, 10, 30, 38)]
    assert [dict(s.tracks_to_predict) for s in found] == [
        {cars["late"]: 0},
        {cars["circling"]: 0},
        {cars["gap"]: 0, cars["circling"]: 0},
        {cars["circling"]: 0},
    ]
    # windows end with the scene
    assert [(s.current_timestep, s.num_timesteps) for s in found] == [(15, 76), (20, 81), (20, 71), (20, 31)]
    for scenario in found:
        scenario.validate()
        assert scenario.tracks.valid.any(axis=1).all()
        assert scenario.source.log == scene.logfile
        assert scenario.extras["kind"] == "window"
        current = scenario.extras["sample_tokens"][scenario.current_timestep // 5]
        assert f"{scenario.tracks_to_predict[0][0]}_{current}" in entries


def test_prediction_of_an_unknown_keyframe_is_quarantined(recorded: Recorded, tmp_path: Path) -> None:
    """Only its own window is."""
    root, scene, _ = recorded
    _linked(root, tmp_path / "dataroot")
    path = tmp_path / "dataroot" / "maps" / "prediction" / "prediction_scenes.json"
    path.parent.mkdir()
    path.write_text(json.dumps({"scene-0061": ["x_y", 5, f"nobody_{scene.samples[9]}"]}))
    (shard,) = shards(CONVERTER, tmp_path / "dataroot", "mini", by="window")
    *refused, good = CONVERTER.records(shard)
    for record, found in zip(refused, ("'y'", "''"), strict=True):
        with pytest.raises(InvalidScenario, match=f"expected keyframes of the scene, found {found}"):
            CONVERTER.scenario(shard, record)
    scenario = CONVERTER.scenario(shard, good)
    assert scenario.tracks_to_predict == ()
    assert [(d.file, d.action, d.location) for d in scenario.defects] == [
        ("maps/prediction/prediction_scenes.json", "assumed", "nobody")
    ]


def test_windows_around_moving_vehicles(recorded: Recorded) -> None:
    root, scene, whole = recorded
    found = scenarios(CONVERTER, root, "mini", by="window")
    assert [s.source.scenario_id for s in found] == ["scene-0061"] * 25
    current = np.array([scene.times.tolist().index(int(s.id.split("@")[1])) for s in found])
    assert current.tolist() == list(range(4, 29))
    for scenario, keyframe in zip(found, current, strict=True):
        assert (scenario.current_timestep, scenario.num_timesteps) == (20, 81)
        first = 5 * (keyframe - 4)
        for token, _ in scenario.tracks_to_predict:
            row = scenario.tracks.index(token)
            assert scenario.tracks.object_type[row] == ObjectType.VEHICLE
            assert scenario.tracks.valid[row].all()
            moved = scenario.tracks.position[row, -1] - scenario.tracks.position[row, 20]
            assert np.hypot(*moved[:2]) > 1.0
            before = whole.tracks.position[whole.tracks.index(token), first : first + 81] + whole.origin
            assert np.abs(scenario.tracks.position[row] + scenario.origin - before).max() < 1e-3
    gap = fixture.token("instance", scene.name, "gap")
    asked = [k for k, s in zip(current.tolist(), found, strict=True) if gap in dict(s.tracks_to_predict)]
    assert asked == [4, 5, 6, 7, 26, 27, 28]  # not annotated at keyframes 20 and 21


def _linked(root: Path, copy: Path) -> None:
    copy.mkdir()
    (copy / "v1.0-mini").symlink_to(root / "v1.0-mini")
    (copy / "maps").mkdir()
    (copy / "maps" / "expansion").symlink_to(root / "maps" / "expansion")
