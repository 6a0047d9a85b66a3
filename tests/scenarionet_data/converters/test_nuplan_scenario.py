"""Content of a nuPlan scenario: ego, objects, lights, tags, routes, and windows."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from scenarionet_data import codec
from scenarionet_data.converters.nuplan import NuPlan
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, ObjectType
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives
from tests.fixtures.motion import motion_errors
from tests.fixtures.reading import scenarios

CONVERTER = NuPlan()


def turn(first: Any, second: Any) -> Any:
    """Smallest angle between headings."""
    return np.abs((np.asarray(first, float) - second + np.pi) % (2 * np.pi) - np.pi)


def only(raw: Path, **options: Any) -> ScenarioDescription:
    (scenario,) = scenarios(CONVERTER, raw, "mini", **options)
    scenario.validate()
    return scenario


@pytest.fixture(scope="module")
def drive() -> drives.Drive:
    return drives.invented(seconds=6.0)


@pytest.fixture(scope="module")
def raw(drive: drives.Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fixture.write_raw(tmp_path_factory.mktemp("nuplan") / "raw", [drive])


@pytest.fixture(scope="module")
def scenario(raw: Path) -> ScenarioDescription:
    """At 20 Hz, timestep t is sweep t of the log."""
    return only(raw, frames="recorded")


# --- identity -------------------------------------------------------------------------------------------


def test_source(scenario: ScenarioDescription, drive: drives.Drive) -> None:
    source = scenario.source
    assert scenario.id == f"nuplan/v1.1/{drive.name}@{source.scenario_id}"
    assert scenario.extras["scene_token"] == source.scenario_id
    assert source.log == drive.name
    assert source.file == f"splits/mini/{drive.name}.db"
    assert source.city == "las_vegas"
    assert source.date == "2021-06-14"
    assert source.crs == "EPSG:32611"
    assert source.licence == "CC BY-NC-SA 4.0"
    assert scenario.map_id == "us-nv-las-vegas-strip-9.15.1915"


@pytest.mark.parametrize(
    ("said", "date"), [("2021-06-13 23:00", "2021-06-13"), ("14.06.21", "2021-06-14"), (None, "2021-06-14")]
)
def test_date_is_iso(drive: drives.Drive, tmp_path: Path, said: str | None, date: str) -> None:
    raw = fixture.write_raw(tmp_path / "raw", [drive])
    (log,) = raw.rglob("*.db")
    with closing(sqlite3.connect(log)) as database, database:
        database.execute("UPDATE log SET date = ?", (said,))
    assert only(raw).source.date == date


def test_timestamps_match_the_sweeps(scenario: ScenarioDescription, raw: Path, drive: drives.Drive) -> None:
    np.testing.assert_allclose(scenario.timestamps, (drive.timestamps - drive.timestamps[0]) * 1e-6, atol=1e-12)
    assert scenario.dt == 0.05
    assert scenario.current_timestep == 40
    slow = only(raw)
    assert slow.dt == 0.1
    assert slow.current_timestep == 20
    np.testing.assert_array_equal(slow.timestamps, scenario.timestamps[::2])


def test_resampled_frames_are_every_second_sweep(scenario: ScenarioDescription, raw: Path) -> None:
    slow = only(raw)
    for name in ("position", "heading", "velocity", "size", "valid"):
        kept = [scenario.tracks.index(track) for track in slow.tracks.ids]
        np.testing.assert_array_equal(getattr(slow.tracks, name), getattr(scenario.tracks, name)[kept][:, ::2])
    np.testing.assert_array_equal(slow.lights.state, scenario.lights.state[:, ::2])


# --- the ego --------------------------------------------------------------------------------------------


def test_ego_position_is_its_box_center(scenario: ScenarioDescription, drive: drives.Drive) -> None:
    ego = scenario.ego_index
    position = scenario.tracks.position[ego].astype(float) + scenario.origin
    heading = drive.rear[:, 2]
    ahead = 1.461 * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    np.testing.assert_allclose(position[:, :2], drive.rear[:, :2] + ahead, atol=1e-4)
    assert turn(scenario.tracks.heading[ego], heading).max() < 1e-6
    np.testing.assert_allclose(scenario.tracks.size[ego, 0], [5.176, 2.297, 1.777], rtol=1e-6)
    assert scenario.tracks.object_type[ego] == ObjectType.VEHICLE
    assert scenario.tracks.is_size_assumed.tolist() == [False] * ego + [True]
    assert scenario.tracks.valid[ego].all()


def test_ego_velocity_is_global(scenario: ScenarioDescription) -> None:
    """The log stores it in the ego frame; on a winding road only the correct rotation agrees with the positions."""
    ego = scenario.ego_index
    position = scenario.tracks.position[ego, :, :2].astype(float)
    moved = (position[2:] - position[:-2]) / (scenario.timestamps[2:] - scenario.timestamps[:-2])[:, None]
    np.testing.assert_allclose(scenario.tracks.velocity[ego, 1:-1], moved, atol=5e-3)
    assert np.ptp(scenario.tracks.heading[ego]) > 0.1


# --- objects --------------------------------------------------------------------------------------------


def test_all_categories_have_a_type(scenario: ScenarioDescription) -> None:
    tracks = scenario.tracks
    kinds = {word: ObjectType(code) for word, code in zip(tracks.source_type, tracks.object_type, strict=True)}
    assert kinds == {
        "vehicle": ObjectType.VEHICLE,
        "bicycle": ObjectType.CYCLIST,
        "pedestrian": ObjectType.PEDESTRIAN,
        "traffic_cone": ObjectType.TRAFFIC_CONE,
        "barrier": ObjectType.TRAFFIC_BARRIER,
        "czone_sign": ObjectType.TRAFFIC_OBJECT,
        "generic_object": ObjectType.OTHER,
        "ego": ObjectType.VEHICLE,
    }
    assert not tracks.is_type_assumed.any()


def test_boxes_match_the_log(scenario: ScenarioDescription, drive: drives.Drive) -> None:
    """Round trip from the raw file to the lake's rows: 0.1 mm and 1e-6 rad."""
    decoded = codec.decode(codec.encode(scenario, "1"), scenario.map)
    tracks, boxes = decoded.tracks, drive.boxes
    rows = [tracks.index(track.hex()) for track in boxes["track"]]
    steps = boxes["step"].to_numpy()
    assert tracks.valid[:-1].sum() == len(boxes)
    found = tracks.position[rows, steps, :2].astype(float) + decoded.origin[:2]
    assert np.abs(found - boxes.select("x", "y").to_numpy()).max() < 1e-4
    assert turn(tracks.heading[rows, steps], boxes["yaw"].to_numpy()).max() < 1e-6
    np.testing.assert_allclose(tracks.size[rows, steps], boxes.select("length", "width", "height"), atol=1e-4)
    velocity = boxes.select("vx", "vy").fill_null(0.0).to_numpy()
    np.testing.assert_allclose(tracks.velocity[rows, steps], velocity, atol=1e-4)
    assert not tracks.position[..., 2].any()
    assert not decoded.has_z


def test_stationary_objects_have_no_velocity(scenario: ScenarioDescription) -> None:
    tracks = scenario.tracks
    is_static = np.isin(tracks.source_type.astype(str), drives.STATIC)
    np.testing.assert_array_equal(tracks.is_velocity_estimated, is_static)
    assert not tracks.velocity[is_static].any()


def test_missing_velocity_is_estimated(drive: drives.Drive, tmp_path: Path) -> None:
    """For moving objects, from positions, and flagged."""
    vehicle = drive.boxes.filter(pl.col("category") == "vehicle")["track"][0]
    is_hidden = (pl.col("track") == vehicle) & (pl.col("step") > 30)
    hidden = drive.boxes.with_columns(
        pl.when(~is_hidden).then(pl.col("vx")).alias("vx"), pl.when(~is_hidden).then(pl.col("vy")).alias("vy")
    )
    scenario = only(fixture.write_raw(tmp_path / "raw", [replace(drive, boxes=hidden)]), frames="recorded")
    row = scenario.tracks.index(vehicle.hex())
    assert scenario.tracks.is_velocity_estimated[row]
    truth = drive.boxes.filter(is_hidden)
    steps = truth["step"].to_numpy()[:-1]  # the estimate at the very end is one-sided
    found = scenario.tracks.velocity[row, steps]
    np.testing.assert_allclose(found, truth.select("vx", "vy").to_numpy()[:-1], atol=0.05)


def test_velocity_is_consistent_with_positions(scenario: ScenarioDescription) -> None:
    velocity, heading = motion_errors(scenario)
    assert velocity.max() < 0.05
    assert heading.max() < 0.01


def test_unknown_category_is_kept_and_flagged(drive: drives.Drive, tmp_path: Path) -> None:
    raw = fixture.write_raw(tmp_path / "raw", [drive])
    (log,) = raw.rglob("*.db")
    with closing(sqlite3.connect(log)) as database, database:
        database.execute("UPDATE category SET name = 'tram' WHERE name = 'barrier'")
    tracks = only(raw).tracks
    assert set(tracks.source_type[tracks.is_type_assumed]) == {"tram"}
    assert set(tracks.object_type[tracks.is_type_assumed]) == {ObjectType.OTHER}


# --- lights ---------------------------------------------------------------------------------------------


def test_lights_match_the_log(scenario: ScenarioDescription, drive: drives.Drive) -> None:
    lights = scenario.lights
    assert lights.ids.tolist() == lights.lane_ids.tolist() == ["64001", "64002", "64003"]
    states = dict(zip(drives.STATUSES, (10, 11, 12, 13), strict=True))
    wanted = np.full(lights.state.shape, LightState.ABSENT, np.uint8)
    for step, connector, status in drive.lights.select("step", "connector", "status").iter_rows():
        wanted[connector - 64001, step] = states[status]
    np.testing.assert_array_equal(lights.state, wanted)
    assert set(np.unique(wanted)) == {0, 10, 11, 12, 13}


def test_light_on_an_unknown_connector_is_kept_and_flagged(scenario: ScenarioDescription) -> None:
    """The stop point is the start of the connector; an unknown connector has none."""
    lights, features = scenario.lights, scenario.map
    assert features is not None
    assert lights.is_lane_in_map.tolist() == [True, True, False]
    assert np.isnan(lights.stop_point[2]).all()
    for row in (0, 1):
        lane = features.polyline[int(np.flatnonzero(features.ids == lights.lane_ids[row])[0])]
        np.testing.assert_allclose(lights.stop_point[row], lane[0], atol=1e-4)


def test_light_with_two_states_is_unknown(drive: drives.Drive, tmp_path: Path) -> None:
    rows = drive.lights.filter(pl.col("connector") == 64001)
    green = rows.filter(pl.col("status") == "green")
    both = pl.concat([drive.lights, green.with_columns(pl.lit("red").alias("status"))])
    lights = only(fixture.write_raw(tmp_path / "raw", [replace(drive, lights=both)]), frames="recorded").lights
    assert set(lights.state[0, green["step"].to_numpy()]) == {LightState.TRAFFIC_LIGHT_UNKNOWN}
    other = rows.filter(pl.col("status") == "red")["step"].to_numpy()
    assert set(lights.state[0, other]) == {LightState.TRAFFIC_LIGHT_RED}


# --- windows, tags, routes ------------------------------------------------------------------------------


def test_scenes_cover_the_log(drive: drives.Drive, tmp_path: Path) -> None:
    raw = fixture.write_raw(tmp_path / "raw", [drive], scene_seconds=2.5, tags=[(0, "b", None), (70, "a", None)])
    found = scenarios(CONVERTER, raw, "mini", frames="recorded")
    assert [scenario.num_timesteps for scenario in found] == [50, 50, 21]
    assert [scenario.current_timestep for scenario in found] == [40, 40, 20]
    assert [scenario.extras["scene"] for scenario in found] == ["scene-000", "scene-001", "scene-002"]
    assert [scenario.extras["tags"] for scenario in found] == [["b"], ["a"], []]
    starts = [scenario.extras["start_timestamp_us"] for scenario in found]
    assert starts == drive.timestamps[[0, 50, 100]].tolist()


def test_sweep_without_a_scene_is_excluded(drive: drives.Drive, tmp_path: Path) -> None:
    raw = fixture.write_raw(tmp_path / "raw", [drive])
    (log,) = raw.rglob("*.db")
    with closing(sqlite3.connect(log)) as database, database:
        late = int(drive.timestamps[100])
        database.execute("UPDATE lidar_pc SET scene_token = NULL WHERE timestamp >= ?", (late,))
    assert only(raw, frames="recorded").num_timesteps == 100


TAGS = [(5, "starting", None), (60, "unprotected_left", 0), (60, "near_bicycle", None), (61, "stopping", 3)]


@pytest.fixture(scope="module")
def tagged(drive: drives.Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    tracks = drive.boxes["track"].unique(maintain_order=True).to_list()
    tags = [(step, kind, None if track is None else tracks[track]) for step, kind, track in TAGS]
    return fixture.write_raw(tmp_path_factory.mktemp("nuplan") / "raw", [drive], tags=tags)


@pytest.mark.parametrize(("frames", "stride"), [("recorded", 1), ("resampled", 2)])
def test_tag_windows_surround_their_sweep(tagged: Path, drive: drives.Drive, frames: str, stride: int) -> None:
    found = scenarios(CONVERTER, tagged, "mini", by="tag", past=1.0, future=1.5, frames=frames)
    assert [scenario.extras["tags"] for scenario in found] == [
        ["starting"],
        ["near_bicycle", "unprotected_left"],
        ["stopping"],
    ]
    for scenario, now in zip(found, (5, 60, 61), strict=True):
        scenario.validate()
        assert scenario.source.scenario_id == drive.lidar_tokens[now].hex()
        assert scenario.extras["lidar_pc_token"] == drive.lidar_tokens[now].hex()
        assert scenario.id == f"nuplan/v1.1/{drive.name}@{drive.lidar_tokens[now].hex()}"
        sweeps = np.arange(now - 20, now + 31)
        sweeps = sweeps[(sweeps >= 0) & ((sweeps - now) % stride == 0)]
        assert scenario.current_timestep == int(np.flatnonzero(sweeps == now)[0])
        np.testing.assert_allclose(
            scenario.timestamps, (drive.timestamps[sweeps] - drive.timestamps[sweeps[0]]) * 1e-6, atol=1e-12
        )


def test_tags_are_selected_by_type(tagged: Path, drive: drives.Drive) -> None:
    chosen = scenarios(CONVERTER, tagged, "mini", by="tag", tags="stopping, unprotected_left")
    assert [scenario.extras["tags"] for scenario in chosen] == [["unprotected_left"], ["stopping"]]
    track = drive.boxes["track"][0].hex()
    assert chosen[0].objects_of_interest == (track,)
    assert scenarios(CONVERTER, tagged, "mini", by="tag", tags="changing_lane") == []


def test_route_and_goal_are_kept(scenario: ScenarioDescription, drive: drives.Drive) -> None:
    route = scenario.extras["roadblock_ids"]
    assert route == ["47000", "58000", "47001"]
    features = scenario.map
    assert features is not None
    blocks = {f"roadblock-{block}" for block in route}
    assert blocks <= set(features.ids)
    on_route = [row for row, extras in enumerate(features.extras) if _roadblock(extras) in route]
    assert len(on_route) == 2 * 4 + 8  # the lanes of two groups and the connectors between them
    goal = scenario.extras["goal"]
    np.testing.assert_allclose([goal["x"], goal["y"]], drive.center[-1] - scenario.origin[:2], atol=1e-6)


def _roadblock(extras: str | None) -> str | None:
    return json.loads(extras).get("roadblock_id") if extras else None


def test_row_order_does_not_matter(
    raw: Path, scenario: ScenarioDescription, tmp_path: Path, drive: drives.Drive
) -> None:
    shuffled = replace(
        drive, boxes=drive.boxes.sample(fraction=1.0, shuffle=True, seed=1), lights=drive.lights.reverse()
    )
    other = only(fixture.write_raw(tmp_path / "raw", [shuffled]), frames="recorded")
    rows = [other.tracks.index(track) for track in scenario.tracks.ids]
    np.testing.assert_array_equal(other.tracks.position[rows], scenario.tracks.position)
    np.testing.assert_array_equal(other.lights.state, scenario.lights.state)


# --- recorded -------------------------------------------------------------------------------------------


def test_recorded_scenario(recordings: Path, tmp_path: Path) -> None:
    """At 10 Hz, timesteps are the recorded ones; counts and values match the recording."""
    folder = recordings / "nuplan" / "recorded" / "262a4b7a1f2c5ab6"
    scenario = only(fixture.write_raw(tmp_path / "raw", [drives.recorded(folder)]))
    boxes, tracks = pl.read_parquet(folder / "tracked_objects.parquet"), scenario.tracks
    assert scenario.num_timesteps == 149
    assert len(tracks) == 325 + 1
    words, counts = np.unique(tracks.source_type.astype(str), return_counts=True)
    wanted = {"generic_object": 133, "pedestrian": 86, "vehicle": 57, "traffic_cone": 48, "bicycle": 1, "ego": 1}
    assert dict(zip(words.tolist(), counts.tolist(), strict=True)) == wanted
    assert tracks.valid[:-1].sum() == len(boxes) == 19_816
    rows = [tracks.index(track) for track in boxes["track_token"]]
    steps = boxes["iteration"].to_numpy()
    found = tracks.position[rows, steps, :2].astype(float) + scenario.origin[:2]
    assert np.abs(found - boxes.select("x", "y").to_numpy()).max() < 1e-4
    assert turn(tracks.heading[rows, steps], boxes["heading"].to_numpy()).max() < 1e-6
    ego = pl.read_parquet(folder / "ego.parquet").select("center_x", "center_y").to_numpy()
    center = tracks.position[scenario.ego_index, :, :2].astype(float) + scenario.origin[:2]
    assert np.abs(center - ego).max() < 1e-4
    assert len(scenario.lights) == 13
    assert (scenario.lights.state != LightState.ABSENT).sum() == 1323
    assert scenario.lights.is_lane_in_map.sum() == 12
