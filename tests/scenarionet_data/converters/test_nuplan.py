"""The nuPlan converter as a whole: conformance on written and recorded data, finding logs and maps, the lake."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuplan import NuPlan, NuPlanOptions
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures import nuplan as fixture
from tests.fixtures import nuplan_drive as drives
from tests.fixtures.reading import scenarios, shards

CONVERTER = NuPlan()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two logs of 8 s with two scenes each, tags, and the map of their city."""
    first = drives.invented()
    second = drives.invented(seed=1, seconds=3.0, num_tracks=8)
    track = first.boxes["track"][0]
    tags = [(0, "starting", None), (45, "unprotected_left", track), (45, "near_vehicle", None), (58, "lead", None)]
    root = tmp_path_factory.mktemp("nuplan") / "raw"
    return fixture.write_raw(root, [first, second], scene_seconds=5.0, tags=tags)


@pytest.fixture(scope="module", params=["262a4b7a1f2c5ab6", "000d90717e5e569d"])
def recorded(request: pytest.FixtureRequest, recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log written from a recorded scenario, and a map around it."""
    drive = drives.recorded(recordings / "nuplan" / "recorded" / request.param)
    return fixture.write_raw(tmp_path_factory.mktemp("nuplan-recorded") / "raw", [drive])


class Conformance(ConverterConformance):
    converter = CONVERTER
    split = "mini"
    damaged_glob = "*.db"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, written: Path) -> Path:
        return written


class TestScenes(Conformance):
    pass


@pytest.mark.long
class TestScenesAsRecorded(Conformance):
    options = {"frames": "recorded"}  # noqa: RUF012
    damaged_glob = "*.gpkg"


@pytest.mark.long
class TestTags(Conformance):
    options = {"by": "tag", "past": 2.0, "future": 3.0}  # noqa: RUF012
    damaged_glob = "*.json"


@pytest.mark.long
class TestTagsAsRecorded(Conformance):
    options = {"by": "tag", "frames": "recorded", "future": 1.0, "tags": "unprotected_left,lead"}  # noqa: RUF012
    damaged_glob = None


class TestRecorded(ConverterConformance):
    """Logs written from the recorded scenarios."""

    converter = CONVERTER
    split = "mini"
    damaged_glob = None

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recorded: Path) -> Path:
        return recorded


# --- finding logs and maps ------------------------------------------------------------------------------


def test_each_log_is_a_shard_and_each_map_is_listed_once(written: Path) -> None:
    found = shards(CONVERTER, written, "mini")
    assert all(
        set(shard.properties) >= {"log", "location"} and shard.properties["log"] == shard.name for shard in found
    )
    assert [len(shard.items) for shard in found] == [1, 1]
    assert [shard.items[0].name for shard in found] == [f"splits/mini/{shard.name}.db" for shard in found]
    (city,) = CONVERTER.maps(str(written), "v1.1", NuPlanOptions())
    assert city.name == "us-nv-las-vegas-strip-9.15.1915"
    assert city.split == ""
    assert len(CONVERTER.map_features(city)) == 55


def test_logs_of_other_splits_are_excluded(written: Path) -> None:
    with pytest.raises(SourceNotFound, match="no logs of split train in it, but of mini; add --split"):
        shards(CONVERTER, written, "train")
    assert len(shards(CONVERTER, written, "boston")) == 2


def test_maps_folder_option_does_not_change_shards(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The maps folder is not part of the shard key, so a lake can be extended after maps move."""
    logs = written / "splits" / "mini"
    shutil.copytree(written / "maps", tmp_path / "moved")
    monkeypatch.delenv("NUPLAN_MAPS_ROOT", raising=False)
    with pytest.raises(SourceNotFound, match="set NUPLAN_MAPS_ROOT"):
        shards(CONVERTER, logs)
    told = shards(CONVERTER, logs, maps=str(tmp_path / "moved"))
    monkeypatch.setenv("NUPLAN_MAPS_ROOT", str(written / "maps"))
    found = shards(CONVERTER, logs)
    assert [shard.key("1") for shard in told] == [shard.key("1") for shard in found]
    assert {shard.options.maps for shard in told} == {str(tmp_path / "moved")}  # type: ignore[attr-defined]
    monkeypatch.delenv("NUPLAN_MAPS_ROOT")  # a worker on another machine does not have it
    assert next(iter(CONVERTER.records(found[0]))).map_id == "us-nv-las-vegas-strip-9.15.1915"


def test_folders_without_logs_are_refused(tmp_path: Path, written: Path) -> None:
    (tmp_path / "scene.json").write_text("[]")
    shutil.copytree(written / "maps", tmp_path / "maps")
    with pytest.raises(SourceNotFound, match=r"no \*\.db in it"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound):
        shards(CONVERTER, tmp_path / "nowhere")


def test_duplicate_log_is_refused(written: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(written, tmp_path / "copy")
    log = next((copy / "splits" / "mini").iterdir())
    (copy / "again").mkdir()
    shutil.copy(log, copy / "again")
    with pytest.raises(SourceNotFound, match="are the same log"):
        shards(CONVERTER, copy, "mini")


@pytest.mark.parametrize(
    "options",
    [
        {"by": "window"},
        {"tags": "unprotected_left"},
        {"frames": "all"},
        {"past": -1.0},
        {"future": float("nan"), "by": "tag"},
        {"radius": float("inf")},
    ],
)
def test_invalid_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(BadParameter):
        NuPlanOptions(**options)


# --- the lake -------------------------------------------------------------------------------------------


def test_city_map_is_stored_once(written: Path, tmp_path: Path) -> None:
    """A scenario loads from the lake unchanged, with its crop of the shared map."""
    report = convert("nuplan", str(written), tmp_path / "lake", split="mini")
    assert report.is_clean
    assert report.converted == 3
    assert len(list((tmp_path / "lake").rglob("us-nv-las-vegas-strip*.parquet"))) == 1
    made = {scenario.id: scenario for scenario in scenarios(CONVERTER, written, "mini")}
    for scenario in ScenarioLoader(tmp_path / "lake", list(made)):
        found = differences(made[scenario.id], scenario)
        assert found in ([], ["scenario.map.polyline", "scenario.map.polygon"]), found
        before, after = made[scenario.id].map, scenario.map
        assert before is not None
        assert after is not None
        for name in ("polyline", "polygon"):  # float32 offsets from a tile's origin, moved to the scenario's
            step = getattr(before, name).values - getattr(after, name).values
            assert np.abs(step).max() < 1e-4
