"""Argoverse 2 sensor logs: frames, windows, types, and refused input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.feather
import pyarrow.parquet
import pytest

from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.errors import CorruptSource
from scenarionet_data.scenario.vocabulary import ObjectType
from tests.fixtures import argoverse2 as fixture
from tests.fixtures import argoverse2_world as world
from tests.fixtures.motion import motion_errors
from tests.fixtures.reading import scenarios

CONVERTER = Argoverse2()


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return fixture.write_sensor_log(tmp_path / "raw", seconds=3.5)


def test_boxes_are_transformed_to_the_city_frame(log: Path) -> None:
    """The ego drives on the generated road, and every box must follow its generated path."""
    (scenario,) = scenarios(CONVERTER, log.parent)
    tracks = scenario.tracks
    position = tracks.position.astype(np.float64) + scenario.origin
    ego = scenario.ego_index
    wanted = world.Mover("", -420.0, -1.75, 6.0, 0.0).position(scenario.timestamps)
    np.testing.assert_allclose(position[ego, :, :2], wanted[:, :2], atol=1e-3)
    bottom = position[..., 2] - tracks.size[..., 2] / 2.0
    height = world.road(_along(position), 0.0)[..., 2]
    assert np.abs(bottom - height)[tracks.valid].max() < 0.06
    speed = np.hypot(*np.moveaxis(tracks.velocity, -1, 0))
    standing = np.isin(tracks.source_type, ["BOLLARD", "SIGN", "CONSTRUCTION_CONE"])
    assert speed[standing].max() < 1e-2


def _along(position: np.ndarray) -> np.ndarray:
    """Path parameter of points beside the road, by fixed-point iteration on their lateral offset."""
    along = position[..., 0]
    for _ in range(20):
        offset = np.hypot(*np.moveaxis(position - world.road(along, 0.0), -1, 0)[:2])
        side = np.sign(position[..., 1] - world.road(along, 0.0)[..., 1])
        along = along + position[..., 0] - world.road(along, side * offset)[..., 0]
    return along


def test_missing_sweep_poses_are_interpolated(tmp_path: Path) -> None:
    exact = fixture.write_sensor_log(tmp_path / "a", seconds=2.0)
    between = fixture.write_sensor_log(tmp_path / "b", seconds=2.0, is_exact=False)
    (first,), (second,) = scenarios(CONVERTER, exact.parent), scenarios(CONVERTER, between.parent)
    assert first.extras["num_interpolated_poses"] == 0
    assert second.extras["num_interpolated_poses"] == first.num_timesteps
    assert not first.tracks.is_interpolated.any()
    assert (second.tracks.is_interpolated.sum(axis=1) == first.num_timesteps * (second.tracks.ids == "AV")).all()
    assert np.abs(first.tracks.position - second.tracks.position).max() < 1e-3
    turn = np.abs(first.tracks.heading - second.tracks.heading)
    assert np.minimum(turn, 2 * np.pi - turn).max() < 1e-5


def test_all_sensor_categories_have_a_type(log: Path) -> None:
    (scenario,) = scenarios(CONVERTER, log.parent)
    tracks = scenario.tracks
    kinds = {word: ObjectType(code) for word, code in zip(tracks.source_type, tracks.object_type, strict=True)}
    assert set(kinds) == {*fixture.SENSOR_CATEGORIES, "EGO_VEHICLE"}
    assert len(set(fixture.SENSOR_CATEGORIES)) == 30
    assert not tracks.is_type_assumed.any()
    assert kinds["BICYCLE"] is ObjectType.OTHER
    assert kinds["BICYCLIST"] is ObjectType.CYCLIST
    assert kinds["CONSTRUCTION_BARREL"] is ObjectType.TRAFFIC_CONE
    assert tracks.is_size_assumed.tolist() == [False] * (len(tracks) - 1) + [True]
    assert tracks.is_velocity_estimated.all()


def test_missing_predecessors_are_completed(log: Path) -> None:
    (scenario,) = scenarios(CONVERTER, log.parent)
    (path,) = (log / "map").glob("*.json")
    segments = json.loads(path.read_text())["lane_segments"]
    one_way = sum(
        lane["id"] not in segments[str(other)]["predecessors"]
        for lane in segments.values()
        for other in lane["successors"]
        if str(other) in segments
    )
    assert scenario.extras["num_completed_links"] == one_way > 0


@pytest.mark.parametrize(
    ("window", "stride", "wanted"),
    [
        (20.0, 0.0, [(0.0, 3.5)]),
        (2.0, 0.0, [(0.0, 1.9), (2.0, 3.5)]),
        (2.0, 1.0, [(0.0, 1.9), (1.0, 2.9), (2.0, 3.5)]),
        (3.0, 1.0, [(0.0, 2.9), (1.0, 3.5)]),
        (2.5, 0.0, [(0.0, 2.4)]),  # what remains is no longer than a history
    ],
)
def test_windows_cover_the_log(log: Path, window: float, stride: float, wanted: list[tuple[float, float]]) -> None:
    found = []
    start = fixture.FIRST_TIME
    for scenario in scenarios(CONVERTER, log.parent, window=window, stride=stride):
        scenario.validate()
        begin = (scenario.extras["start_timestamp_ns"] - start) * 1e-9
        found.append((begin, begin + scenario.timestamps[-1]))
        assert scenario.tracks.valid.any(axis=1).all()
        assert scenario.source.log == log.name
        assert scenario.id.endswith(f"@{scenario.extras['start_timestamp_ns']}")
    np.testing.assert_allclose(found, wanted, atol=0.01)  # jitter of the sweeps


def test_estimated_velocity_matches_the_true_one(log: Path) -> None:
    (scenario,) = scenarios(CONVERTER, log.parent)
    errors, turns = motion_errors(scenario)
    assert np.median(errors) < 0.01
    assert np.quantile(turns, 0.99) < 0.1


@pytest.mark.parametrize("name", ["city_SE3_egovehicle.feather", "map"])
def test_log_without_poses_or_map_is_refused(log: Path, name: str) -> None:
    target = log / name
    shutil.rmtree(target) if target.is_dir() else target.unlink()
    with pytest.raises(CorruptSource, match="download"):
        scenarios(CONVERTER, log.parent)


def test_boxes_outside_the_poses_are_dropped(log: Path) -> None:
    (whole,) = scenarios(CONVERTER, log.parent)
    path = log / "city_SE3_egovehicle.feather"
    poses = pa.feather.read_table(path)
    pa.feather.write_feather(poses.slice(0, len(poses) // 2), path)
    (scenario,) = scenarios(CONVERTER, log.parent)
    assert scenario.num_timesteps < whole.num_timesteps
    (defect,) = [each for each in scenario.defects if each.action == "dropped"]
    assert defect.reason == "expected a time with a pose of the ego, found another"


def test_log_without_usable_poses_is_refused(log: Path) -> None:
    path = log / "city_SE3_egovehicle.feather"
    pa.feather.write_feather(pa.feather.read_table(path).slice(0, 0), path)
    with pytest.raises(CorruptSource, match="expected poses of the ego, found none"):
        scenarios(CONVERTER, log.parent)


def test_unknown_category_is_kept_and_flagged(log: Path) -> None:
    path = log / "annotations.feather"
    table = pa.feather.read_table(path)
    words = ["HOVERCRAFT" if word == "BUS" else word for word in table["category"].to_pylist()]
    table = table.set_column(table.column_names.index("category"), "category", pa.array(words))
    pa.feather.write_feather(table, path)
    tracks = scenarios(CONVERTER, log.parent)[0].tracks
    assert set(tracks.source_type[tracks.is_type_assumed]) == {"HOVERCRAFT"}
