"""The nuScenes converter as a whole: conformance, finding releases and splits, options, refused input."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.conversion import convert
from scenarionet_data.converters.nuscenes import NuScenes, NuScenesOptions
from scenarionet_data.converters.nuscenes.types import is_in_split
from scenarionet_data.converters.splits import guess_split
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.testing import ConverterConformance
from tests.fixtures import nuscenes as fixture
from tests.fixtures.nuscenes_world import write_district
from tests.fixtures.reading import scenarios, shards

CONVERTER = NuScenes()
TABLES = """attribute calibrated_sensor category ego_pose instance log sample sample_annotation sample_data scene
    sensor""".split()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two generated scenes of 12 s in two locations; read-only."""
    root = tmp_path_factory.mktemp("nuscenes")
    fixture.write_invented(root, num_scenes=2, num_keyframes=25)
    return root


@pytest.fixture
def raw(written: Path, tmp_path: Path) -> Path:
    """A writable copy of them."""
    shutil.copytree(written, tmp_path / "raw")
    return tmp_path / "raw"


class TestScenes(ConverterConformance):
    converter = CONVERTER
    split = "mini"
    damaged_glob = "v1.0-mini/sample_annotation.json"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, written: Path) -> Path:
        return written


class TestWindows(TestScenes):
    damaged_glob = "maps/expansion/*.json"
    options = {"by": "window", "past": 1.0, "future": 3.0}  # noqa: RUF012


class TestLyft(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "train_data/ego_pose.json"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_lyft(folder / "raw")
        return folder / "raw"


# --- finding releases -------------------------------------------------------------------------------------


def test_shards_hold_scenes_of_one_location(written: Path) -> None:
    found = shards(CONVERTER, written, "mini")
    assert [shard.name for shard in found] == [
        "v1.0-mini-boston-seaport-scene-00000-of-00001",
        "v1.0-mini-singapore-onenorth-scene-00000-of-00001",
    ]
    assert [item.name for shard in found for item in shard.items] == ["v1.0-mini/scene-0103", "v1.0-mini/scene-0061"]
    maps = list(CONVERTER.maps(str(written), "v1.0", NuScenesOptions()))
    assert [shard.name for shard in maps] == ["boston-seaport", "singapore-onenorth"]
    assert not list(CONVERTER.maps(str(written), "v1.0", NuScenesOptions(has_map=False)))


def test_release_folder_as_raw_path(written: Path) -> None:
    assert shards(CONVERTER, written / "v1.0-mini", "mini") == shards(CONVERTER, written, "mini")


def test_splits_are_the_official_ones(written: Path) -> None:
    names = {split: [s.source.scenario_id for s in scenarios(CONVERTER, written, split)] for split in
             ("mini_train", "mini_val")}  # fmt: skip
    assert names == {"mini_train": ["scene-0061"], "mini_val": ["scene-0103"]}
    with pytest.raises(SourceNotFound, match=r"v1\.0-mini has no split 'train'; give as split one of mini,"):
        shards(CONVERTER, written, "train")


def test_numbers_of_scenes_in_splits() -> None:
    """The official splits have 700 training and 150 validation scenes; 110 of the other 960 numbers are unused."""
    names = [f"scene-{number:04d}" for number in range(1, 1111)]
    val = [name for name in names if is_in_split(name, "val")]
    assert not set(val) & {name for name in names if is_in_split(name, "train")}
    for known, split in (("0001", "train"), ("0003", "val"), ("0061", "train"), ("0796", "val"), ("1110", "train")):
        assert is_in_split(f"scene-{known}", split)
    train_val = [name for name in names if is_in_split(name, "train_val")]
    assert set(train_val) == {n for n in names if is_in_split(n, "train") and not is_in_split(n, "train", True)}
    assert train_val[-1] == "scene-0300"
    assert is_in_split("host-a004", "train")
    assert is_in_split("host-a004", "whatever")


def test_several_releases(raw: Path) -> None:
    fixture.write_invented(raw, num_scenes=3, num_keyframes=9, release="v1.0-trainval")
    assert {s.source.scenario_id for s in scenarios(CONVERTER, raw, "val")} == {"scene-0103", "scene-0553"}
    shutil.copytree(raw / "v1.0-mini", raw / "copy")
    with pytest.raises(SourceNotFound, match="give the folder of one of them"):
        shards(CONVERTER, raw, "mini")


def test_split_is_guessed_from_the_release(written: Path, tmp_path: Path) -> None:
    assert guess_split(str(written)) == guess_split(str(written / "v1.0-mini")) == "mini"
    for release in ("v1.0-trainval", "v1.0-mini"):
        (tmp_path / release).mkdir()
    with pytest.raises(BadParameter, match="contains the splits mini, train"):
        guess_split(str(tmp_path))


def test_folder_of_another_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceNotFound, match=r"scene\.json"):
        shards(CONVERTER, tmp_path)
    (tmp_path / "v1.0-mini").mkdir()
    (tmp_path / "v1.0-mini" / "scene.json").write_text("[]")
    with pytest.raises(CorruptSource, match="no such table"):
        shards(CONVERTER, tmp_path, "mini")


def test_lyft_is_detected_by_its_location(tmp_path: Path) -> None:
    written = fixture.write_lyft(tmp_path)
    (scenario,) = scenarios(CONVERTER, tmp_path, "train")
    assert scenario.map is None
    assert scenario.map_id is None
    assert scenario.source.city == "Palo Alto"
    assert scenario.tracks.size[scenario.ego_index, 0].tolist() == pytest.approx([4.87, 1.85, 1.8])
    assert not scenario.tracks.is_type_assumed.any()
    assert scenario.dt == pytest.approx(0.1)
    steps = scenario.extras["keyframe_timesteps"]
    assert steps == list(range(0, 2 * len(written.times), 2))
    np.testing.assert_allclose(scenario.timestamps[steps], (written.times - written.times[0]) * 1e-6, atol=1e-7)


def test_user_defined_location_may_have_a_map(tmp_path: Path) -> None:
    fixture.write_lyft(tmp_path)
    write_district(tmp_path / "maps" / "expansion", "Palo Alto")
    (scenario,) = scenarios(CONVERTER, tmp_path, "train")
    (shared,) = CONVERTER.maps(str(tmp_path), "v1.0", NuScenesOptions())
    assert scenario.map_id == shared.name == "Palo-Alto"


@pytest.mark.parametrize(
    "options", [{"by": "tag"}, {"past": -1.0}, {"future": float("nan")}, {"rate": 1}, {"radius": -5.0}]
)
def test_invalid_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(BadParameter):
        NuScenesOptions(**options)


def test_changed_tables_or_maps_change_the_shards(raw: Path) -> None:
    def keys() -> list[str]:
        return [shard.key("1") for shard in shards(CONVERTER, raw, "mini")]

    before = keys()
    boston = raw / "maps" / "expansion" / "boston-seaport.json"
    boston.write_text(boston.read_text() + " ")
    changed = keys()
    assert [a == b for a, b in zip(before, changed, strict=True)] == [False, True]
    table = raw / "v1.0-mini" / "ego_pose.json"
    table.write_text(table.read_text() + " ")
    assert not set(keys()) & set(changed)


# --- round trip through a lake ----------------------------------------------------------------------------


def test_scenes_and_windows_share_one_lake(written: Path, tmp_path: Path) -> None:
    lake = tmp_path / "lake"
    first = convert("nuscenes", str(written), lake, split="mini")
    options = NuScenesOptions(by="window", past=1.0, future=3.0)
    second = convert("nuscenes", str(written), lake, split="mini", options=options)
    assert first.is_clean
    assert second.is_clean
    assert (first.converted, first.shards) == (2, 4)  # two of the shards are maps,
    assert second.shards == 2  # which the windows share
    wanted = {s.id: s for s in scenarios(CONVERTER, written, "mini")}
    loader = ScenarioLoader(lake, list(wanted))
    for loaded in (loader[number] for number in range(len(loader))):
        scenario = wanted[loaded.id]
        assert loaded.map is not None
        assert scenario.map is not None
        assert loaded.map.ids.tolist() == scenario.map.ids.tolist()
        assert np.abs(loaded.map.polyline.values - scenario.map.polyline.values).max() < 1e-4
        assert np.array_equal(loaded.tracks.position, scenario.tracks.position)


# --- bad input --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("how", ["missing", "empty", "truncated", "foreign", "corrupt inside"])
def test_damaged_table_is_named(raw: Path, table: str, how: str) -> None:
    path = raw / "v1.0-mini" / f"{table}.json"
    content = path.read_bytes()
    if how == "missing":
        path.unlink()
    else:
        second = content.index(b'"token"', content.index(b'"token"') + 1)
        damaged = {"empty": b"", "truncated": content[:-40], "foreign": b'[{"name": "x"}]'}
        damaged["corrupt inside"] = content[:second] + content[second + 1 :]
        path.write_bytes(damaged[how])
    with pytest.raises((CorruptSource, SourceNotFound, InvalidScenario), match=table):
        scenarios(CONVERTER, raw, "mini")


def edit(path: Path, change: Callable[[Any], object]) -> None:
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content, indent=0))


Change = Callable[[list[dict[str, Any]]], object]
BROKEN_ROWS: dict[str, tuple[str, Change, str]] = {
    "unknown sample": ("sample_annotation", lambda rows: rows[7].update(sample_token="f" * 32), "nbr_annotations"),
    "unknown instance": ("sample_annotation", lambda rows: rows[7].update(instance_token="f" * 32), "instance_token"),
    "unknown attribute": ("sample_annotation", lambda rows: rows[7].update(attribute_tokens=["f"]), "attribute_tok"),
    "missing row": ("sample_annotation", lambda rows: rows.pop(7), "nbr_annotations"),
    "doubled row": ("sample_annotation", lambda rows: rows.insert(7, rows[7]), "found two"),
    "no translation": ("sample_annotation", lambda rows: rows[7].pop("translation"), "finite"),
    "short translation": ("sample_annotation", lambda rows: rows[7].update(translation=[1.0]), "finite"),
    "no number": ("sample_annotation", lambda rows: rows[7].update(size=[1.0, None, 2.0]), "finite"),
    "not finite": ("sample_annotation", lambda rows: rows[7].update(size=[1.0, float("nan"), 2.0]), "finite"),
    "no size": ("sample_annotation", lambda rows: rows[7].update(size=[1.0, 0.0, 2.0]), "above 0"),
    "no rotation": ("sample_annotation", lambda rows: rows[7].update(rotation=[0.0] * 4), "length 1"),
    "unknown category": ("instance", lambda rows: rows[0].update(category_token="f"), "category_token"),
    "missing instance": ("instance", lambda rows: rows.pop(0), "instance_token"),
    "missing sample": ("sample", lambda rows: rows.pop(3), "expected 25"),
    "unknown scene": ("sample", lambda rows: rows[3].update(scene_token="f"), "expected 25"),
    "samples at one time": ("sample", lambda rows: rows[3].update(timestamp=rows[2]["timestamp"]), "increasing"),
    "unknown log": ("scene", lambda rows: rows[0].update(log_token="f"), "expected a log"),
    "missing pose": ("ego_pose", lambda rows: rows.pop(7), "expected a finite pose"),
    "unknown pose": ("sample_data", lambda rows: rows[7].update(ego_pose_token="f"), "expected a finite pose"),
    "no sweeps": ("sample_data", lambda rows: rows.__delitem__(slice(0, 400)), "lidar sweeps"),
}


@pytest.mark.parametrize("what", BROKEN_ROWS)
def test_bad_row_quarantines_only_its_scene(raw: Path, what: str) -> None:
    """The first rows of each table belong to the first scene: it is quarantined, the other is converted."""
    table, change, reason = BROKEN_ROWS[what]
    edit(raw / "v1.0-mini" / f"{table}.json", change)
    reasons, converted = [], []
    for shard in shards(CONVERTER, raw, "mini"):
        for record in CONVERTER.records(shard):
            try:
                converted.append(CONVERTER.scenario(shard, record).source.scenario_id)
            except InvalidScenario as error:
                reasons.append(str(error))
    assert converted == ["scene-0103"]
    assert len(reasons) == 1
    assert "scene-0061" in reasons[0]
    assert reason in reasons[0]


@pytest.mark.parametrize("content", ["", "[]", '{"scene-0061": 5}'])
def test_damaged_prediction_list_is_named(raw: Path, content: str) -> None:
    path = raw / "maps" / "prediction" / "prediction_scenes.json"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(CorruptSource, match=r"prediction_scenes\.json: expected lists of"):
        scenarios(CONVERTER, raw, "mini", by="window")


def test_damaged_scenes_are_quarantined_and_the_rest_converted(raw: Path, tmp_path: Path) -> None:
    """A quarantined scene and a location without its map are counted; everything else is in the lake."""
    (raw / "maps" / "expansion" / "boston-seaport.json").unlink()
    lake = tmp_path / "lake"
    report = convert("nuscenes", str(raw), lake, split="mini")
    assert (report.converted, report.quarantined, report.failed) == (1, 1, [])
    assert [s.source.scenario_id for s in ScenarioLoader(lake)[:]] == ["scene-0061"]
    with pytest.raises(InvalidScenario, match=r"expected boston-seaport.json in maps/expansion, found none; download"):
        scenarios(CONVERTER, raw, "mini")
    shutil.rmtree(raw / "maps")
    with pytest.raises(SourceNotFound, match="no maps; download"):
        scenarios(CONVERTER, raw, "mini")
    assert [s.map for s in scenarios(CONVERTER, raw, "mini", has_map=False)] == [None, None]


def drop_node(content: dict[str, Any]) -> None:
    del content["node"][5]


@pytest.mark.parametrize(
    "change",
    [
        drop_node,
        lambda content: content.pop("lane"),
        lambda content: content.update(version="1.2"),
        lambda content: content["node"][3].update(x=float("inf")),
        lambda content: content["polygon"][1].update(
            exterior_node_tokens=content["polygon"][1]["exterior_node_tokens"][:2]
        ),
        lambda content: next(iter(content["arcline_path_3"].values()))[0].update(shape="LXL"),
        lambda content: next(iter(content["arcline_path_3"].values()))[0].update(radius=-1.0),
        lambda content: content["lane_divider"][0].update(line_token="nowhere"),
        lambda content: content["walkway"][0].update(polygon_token="nowhere"),
    ],
)
def test_damaged_map_fails_only_its_location(raw: Path, tmp_path: Path, change: Callable[[Any], object]) -> None:
    edit(raw / "maps" / "expansion" / "boston-seaport.json", change)
    report = convert("nuscenes", str(raw), tmp_path / "lake", split="mini")
    assert report.converted == 1
    assert len(report.failed) == 2  # the map, and the location's scenes
    assert all("boston-seaport.json: expected a nuScenes map expansion v1.3" in reason for _, reason in report.failed)
