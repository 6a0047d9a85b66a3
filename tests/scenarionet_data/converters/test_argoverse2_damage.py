"""Argoverse 2 recordings with damaged rows, poses and files, and what is not read of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import pytest

from scenarionet_data.conversion import convert
from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.testing import differences
from tests.fixtures import argoverse2 as fixture
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage, damage_json, damage_table

CONVERTER = Argoverse2()
NAN = float("nan")


def damage_arrow(path: Path, rng: np.random.Generator) -> str:
    if path.suffix == ".json":
        return damage_json(path, rng)
    read, write = FORMS[path.suffix]
    table, how = damage_table(read(path), rng)
    write(table, path)
    return how


FORMS: dict[str, tuple[Callable[[Path], pa.Table], Callable[[pa.Table, Path], None]]] = {
    ".parquet": (pa.parquet.read_table, pa.parquet.write_table),
    ".feather": (pa.feather.read_table, pa.feather.write_feather),
}


def damage_some(path: Path, rng: np.random.Generator, ways: list[tuple[str, Any]], is_damaged: Any) -> RowDamage:
    """Damage 1 % of the rows that ``is_damaged`` allows, at least one in each way, and repeat one."""
    read, write = FORMS[path.suffix]
    table = read(path)
    rows = table.to_pylist()
    allowed = [number for number, row in enumerate(rows) if is_damaged(row)]
    chosen = rng.choice(allowed, max(len(rows) // 100, len(ways)) + 1, replace=False).tolist()
    name = "track_id" if "track_id" in table.column_names else "track_uuid"
    tracks = {rows[number][name] for number in chosen}
    for number, row in enumerate(chosen[1:]):
        field, value = ways[number % len(ways)]
        rows[row][field] = value
    rows.append(dict(rows[chosen[0]]))
    write(pa.Table.from_pylist(rows, table.schema), path)
    return RowDamage(frozenset(tracks), num_added=1)


class TestForecastingDamage(DamageConformance):
    converter = CONVERTER

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        root = tmp_path_factory.mktemp("forecasting")
        fixture.write_forecasting(root, num_scenarios=2, num_tracks=12)
        return root

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        ways = [
            ("position_x", NAN), ("position_y", None), ("heading", float("inf")), ("velocity_x", 1e9),
            ("position_x", 1e12), ("timestep", 4000), ("timestep", None), ("track_id", None),
        ]  # fmt: skip
        path = sorted(raw.rglob("*.parquet"))[0]
        found = damage_some(path, rng, ways, lambda row: row["track_id"] != "AV" and row["timestep"] > 0)
        name = path.stem.removeprefix("scenario_")
        return RowDamage(frozenset(f"{name} {track}" for track in found.tracks), found.num_added)

    def damage_input(self, path: Path, rng: np.random.Generator) -> str:
        return damage_arrow(path, rng)


class TestSensorDamage(DamageConformance):
    converter = CONVERTER

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        return fixture.write_sensor_log(tmp_path_factory.mktemp("sensor"), seconds=3.5).parent

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        ways = [
            ("tx_m", NAN), ("ty_m", 1e12), ("length_m", 0.0), ("width_m", None), ("height_m", 1e9), ("qw", 7.0),
            ("timestamp_ns", 5), ("track_uuid", None),
        ]  # fmt: skip
        (path,) = raw.rglob("annotations.feather")
        return damage_some(path, rng, ways, lambda row: True)

    def damage_input(self, path: Path, rng: np.random.Generator) -> str:
        return damage_arrow(path, rng)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return fixture.write_sensor_log(tmp_path / "raw", seconds=3.5)


def with_ego_boxes(log: Path) -> None:
    """Turn a log of the sensor dataset into one of the scenario mining dataset."""
    path = log / "annotations.feather"
    rows = pa.feather.read_table(path).to_pylist()
    place = {"tx_m": 0.0, "ty_m": 0.0, "tz_m": 0.0, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    size = {"length_m": 4.877, "width_m": 2.0, "height_m": 1.473}
    names = {"category": "EGO_VEHICLE", "track_uuid": "6f0c", "num_interior_pts": 1}
    for time in sorted({row["timestamp_ns"] for row in rows}):
        rows.append({**rows[0], **place, **size, **names, "timestamp_ns": time})
    pa.feather.write_feather(pa.Table.from_pylist(rows), log / "annotations_with_ego.feather")
    path.unlink()


def test_log_of_the_scenario_mining_dataset_has_the_ego_once(log: Path) -> None:
    (wanted,) = scenarios(CONVERTER, log.parent)
    with_ego_boxes(log)
    (found,) = scenarios(CONVERTER, log.parent)
    assert found.source.file == f"{log.name}/annotations_with_ego.feather"
    assert [field for field in differences(wanted, found) if field != "scenario.source.file"] == []
    assert found.defects == ()


def test_what_is_not_read_of_a_log_is_listed(log: Path, tmp_path: Path) -> None:
    annotations = (log / "annotations.feather").read_bytes()
    with_ego_boxes(log)
    (log / "annotations.feather").write_bytes(annotations)
    (log / "sensors" / "lidar").mkdir(parents=True)
    (log / "calibration").mkdir()
    (log / "calibration" / "intrinsics.feather").write_bytes(b"")
    other = fixture.write_sensor_log(log.parent / "val", seed=1, seconds=2.0)
    report = convert("argoverse2", log.parent, tmp_path / "lake", split="train")
    assert report.converted == 1
    found = {(each.what.partition(":")[0].partition(",")[0], each.count, each.reason) for each in report.passed_over}
    assert found == {
        ("files *.feather", 2, "not read by this converter"),
        ("files *.feather", 2, "of another split than train"),
        ("files *.json", 1, "of another split than train"),
        ("folders sensors", 1, "its content is not read"),
    }
    assert other.name not in report.defects


def change(path: Path, **values: Any) -> None:
    """Set values of a Feather file: column = (row, value)."""
    table = pa.feather.read_table(path)
    rows = table.to_pylist()
    for name, (row, value) in values.items():
        rows[row][name] = value
    pa.feather.write_feather(pa.Table.from_pylist(rows, table.schema), path)


def test_one_bad_box_costs_one_box(log: Path, tmp_path: Path) -> None:
    whole = convert("argoverse2", log.parent, tmp_path / "whole")
    change(log / "annotations.feather", tx_m=(17, NAN))
    report = convert("argoverse2", log.parent, tmp_path / "lake")
    assert (report.converted, report.quarantined, report.dropped) == (whole.converted, 0, 1)
    assert report.defects[0].location == "row 17"


@pytest.mark.parametrize(("field", "value"), [("tx_m", NAN), ("qw", 5.0), ("ty_m", 1e12), ("timestamp_ns", 0)])
def test_one_bad_pose_is_interpolated(log: Path, field: str, value: float) -> None:
    (whole,) = scenarios(CONVERTER, log.parent)
    path = log / "city_SE3_egovehicle.feather"
    times = pa.feather.read_table(path)["timestamp_ns"].to_pylist()
    row = times.index(whole.extras["start_timestamp_ns"] + round(whole.timestamps[10] * 1e9))
    change(path, **{field: (row, value)})
    (scenario,) = scenarios(CONVERTER, log.parent)
    assert scenario.extras["num_interpolated_poses"] == whole.extras["num_interpolated_poses"] + 1
    bad, filled = scenario.defects
    assert (bad.action, bad.location, bad.count) == ("dropped", f"row {row:,}", 1)
    assert (filled.action, filled.location, filled.count) == ("assumed", f"sweep {times[row]}", 1)
    assert scenario.tracks.is_interpolated[-1].sum() == 1
    np.testing.assert_allclose(scenario.tracks.position, whole.tracks.position, atol=0.01)


def test_bad_element_of_a_map_costs_its_feature(log: Path, tmp_path: Path) -> None:
    (path,) = (log / "map").iterdir()
    archive = json.loads(path.read_text())
    lost = next(iter(archive["pedestrian_crossings"]))
    archive["pedestrian_crossings"][lost]["edge1"][0]["x"] = NAN
    path.write_text(json.dumps(archive))
    report = convert("argoverse2", log.parent, tmp_path / "lake")
    assert (report.converted, report.dropped) == (1, 1)
    assert report.defects[0].location == f"pedestrian_crossings {lost}"
    assert report.defects[0].file == f"{log.name}/map/{path.name}"
