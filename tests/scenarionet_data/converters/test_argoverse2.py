"""The Argoverse 2 converter as a whole: conformance on written and recorded data, finding recordings, options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute
import pyarrow.feather
import pyarrow.parquet
import pytest

from scenarionet_data.converters.argoverse2 import Argoverse2, Argoverse2Options
from scenarionet_data.errors import BadParameter, InvalidScenario, SourceNotFound
from scenarionet_data.testing import ConverterConformance
from tests.fixtures import argoverse2 as fixture
from tests.fixtures.reading import scenarios, shards

CONVERTER = Argoverse2()


class TestForecasting(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.parquet"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_forecasting(folder / "raw", num_scenarios=3, num_tracks=20, num_timesteps=60)
        return folder / "raw"


@pytest.mark.long
class TestForecastingMaps(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.json"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_forecasting(folder / "raw", num_scenarios=2, seed=1, num_tracks=5, num_timesteps=110)
        return folder / "raw"


class TestSensor(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "annotations.feather"
    options = {"window": 2.0, "stride": 1.0}  # noqa: RUF012

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_sensor_log(folder / "raw", seconds=3.5)
        fixture.write_sensor_log(folder / "raw", seed=1, seconds=1.0)
        return folder / "raw"


@pytest.mark.long
class TestSensorPoses(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "city_SE3_egovehicle.feather"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_sensor_log(folder / "raw", seconds=2.0, is_exact=False)
        return folder / "raw"


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    split = "val"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recordings: Path) -> Path:
        return recordings / "argoverse2"


def test_forecasting_and_sensor_recordings_are_distinguished(tmp_path: Path) -> None:
    fixture.write_forecasting(tmp_path / "motion-forecasting" / "val", num_scenarios=2, num_tracks=3)
    log = fixture.write_sensor_log(tmp_path / "sensor" / "val", seconds=1.0)
    fixture.write_sensor_log(tmp_path / "sensor" / "train", seed=1, seconds=1.0)
    assert [s.name for s in shards(CONVERTER, tmp_path, "val")] == [
        "forecasting-00000-of-00001",
        f"sensor-{log.name}",
    ]
    assert [s.properties for s in shards(CONVERTER, tmp_path, "val")] == [
        {"kind": "forecasting"},
        {"kind": "sensor", "log": log.name, "location": "PIT"},
    ]
    assert [len(s.items) for s in shards(CONVERTER, tmp_path, "val", kind="forecasting")] == [2]
    assert [s.name for s in shards(CONVERTER, tmp_path, "val", kind="sensor")] == [f"sensor-{log.name}"]
    assert [s.name for s in shards(CONVERTER, log, "val")] == [f"sensor-{log.name}"]
    with pytest.raises(SourceNotFound, match="give the folder of split test"):
        shards(CONVERTER, tmp_path, "test")


def test_folders_without_recordings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "tables.json").write_text("[]")
    with pytest.raises(SourceNotFound, match=r"no scenario_\*\.parquet and no annotations\.feather"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound):
        shards(CONVERTER, tmp_path / "nowhere")


def test_parquet_file_of_another_dataset_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    pa.parquet.write_table(pa.table({"iteration": [1, 2]}), tmp_path / "x" / "scenario_x.parquet")
    with pytest.raises(InvalidScenario, match="is this an Argoverse 2 file"):
        scenarios(CONVERTER, tmp_path)


@pytest.mark.parametrize("options", [{"kind": "lidar"}, {"window": 0.0}, {"stride": -1.0}, {"window": float("nan")}])
def test_invalid_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(BadParameter):
        Argoverse2Options(**options)


def test_changed_map_changes_the_shard(tmp_path: Path) -> None:
    (forecasting,) = fixture.write_forecasting(tmp_path, num_scenarios=1, num_tracks=3)
    (before,) = shards(CONVERTER, forecasting.parent)
    (path,) = forecasting.glob("*.json")
    path.write_text(path.read_text() + " ")
    (after,) = shards(CONVERTER, forecasting.parent)
    assert before.key("1") != after.key("1")
