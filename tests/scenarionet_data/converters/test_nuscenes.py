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
from scenarionet_data.converters.nuscenes.map_features import read_map
from scenarionet_data.converters.nuscenes.types import is_in_split
from scenarionet_data.converters.splits import guess_split
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.scenario.description import ScenarioDescription
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


@pytest.mark.long
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


@pytest.mark.long
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
    "options", [{"by": "tag"}, {"past": -1.0}, {"future": float("nan")}, {"frames": "all"}, {"radius": -5.0}]
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


@pytest.mark.long
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
@pytest.mark.parametrize("how", ["missing", "empty", "truncated", "foreign", "folder"])
def test_damaged_table_is_named(raw: Path, table: str, how: str) -> None:
    path = raw / "v1.0-mini" / f"{table}.json"
    content = path.read_bytes()
    path.unlink()
    if how == "folder":
        path.mkdir()
    elif how != "missing":
        damaged = {"empty": b"", "truncated": content[:-40], "foreign": b'[{"name": "x"}]'}
        path.write_bytes(damaged[how])
    with pytest.raises((CorruptSource, SourceNotFound, InvalidScenario), match=table):
        scenarios(CONVERTER, raw, "mini")


def edit(path: Path, change: Callable[[Any], object]) -> None:
    content = json.loads(path.read_text())
    change(content)
    path.write_text(fixture.to_json(content))


Change = Callable[[list[dict[str, Any]]], object]
FOREIGN = "f" * 32
BAD_BOXES: dict[str, tuple[dict[str, Any], str]] = {
    "unknown sample": ({"sample_token": FOREIGN}, "sample_token: expected a known keyframe"),
    "a number as sample": ({"sample_token": 5}, "sample_token: expected a known keyframe"),
    "unknown instance": ({"instance_token": FOREIGN}, "instance_token: expected a known object"),
    "no translation": ({"translation": None}, "translation: expected finite metres"),
    "short translation": ({"translation": [1.0]}, "translation: expected finite metres"),
    "a text in translation": ({"translation": ["here", 1.0, 2.0]}, "translation: expected finite metres"),
    "far away": ({"translation": [1e12, 0.0, 0.0]}, "translation: expected a position within"),
    "a jump": ({"translation": [1900.0, 1200.0, 0.0]}, "translation: expected less than 150 m/s"),
    "no number": ({"size": [1.0, None, 2.0]}, "size: expected a size above 0"),
    "not finite": ({"size": [1.0, float("nan"), 2.0]}, "size: expected a size above 0"),
    "no size": ({"size": [1.0, 0.0, 2.0]}, "size: expected a size above 0"),
    "large": ({"size": [1.0, 1e9, 2.0]}, "size: expected a size above 0"),
    "no rotation": ({"rotation": [0.0] * 4}, "rotation: expected finite radians"),
}
BAD_ROWS: dict[str, tuple[str, Change, list[str]]] = {
    "no record": ("sample_annotation", lambda rows: rows.insert(7, 5), ["dropped 1 sample_token"]),
    "missing row": ("sample_annotation", lambda rows: rows.pop(7), ["assumed 1 nbr_annotations"]),
    "doubled row": (
        "sample_annotation",
        lambda rows: rows.insert(7, rows[7]),
        ["dropped 1 sample_token", "assumed 1 nbr_annotations"],
    ),
    "unknown attribute": (
        "sample_annotation",
        lambda rows: rows[7].update(attribute_tokens=[FOREIGN]),
        ["assumed 1 attribute_tokens"],
    ),
    "no attributes": ("sample_annotation", lambda rows: rows[7].update(attribute_tokens=None), []),
    "unknown category": ("instance", lambda rows: rows[0].update(category_token="f"), ["assumed 1 category_token"]),
    "a list as category": ("instance", lambda rows: rows[0].update(category_token=[]), ["assumed 1 category_token"]),
    "no number of annotations": (
        "instance",
        lambda rows: rows[0].update(nbr_annotations="many"),
        ["assumed 1 nbr_annotations"],
    ),
    "missing instance": ("instance", lambda rows: rows.pop(0), ["dropped 25 instance_token"]),
    "missing sample": ("sample", lambda rows: rows.pop(3), ["assumed 1 nbr_samples", "dropped 26 sample_token"]),
    "unknown scene": ("sample", lambda rows: rows[3].update(scene_token="f"), ["dropped 1 scene_token", "dropped 26"],),
    "a sample without time": (
        "sample",
        lambda rows: rows[3].update(timestamp=None),
        ["dropped 1 timestamp", "dropped 26 sample_token"],
    ),
    "a sample long ago": (
        "sample",
        lambda rows: rows[3].update(timestamp=5),
        ["dropped 1 timestamp", "dropped 26 sample_token"],
    ),
    "samples at one time": (
        "sample",
        lambda rows: rows[3].update(timestamp=rows[2]["timestamp"]),
        ["dropped 1 timestamp", "dropped 26 sample_token"],
    ),
    "unknown log": ("scene", lambda rows: rows[0].update(log_token="f"), ["assumed 1 log_token"]),
    "no location": ("log", lambda rows: rows[0].update(location=None), ["assumed 1 location"]),
    "a number of samples": ("scene", lambda rows: rows[0].update(nbr_samples=[]), []),
    "missing pose": ("ego_pose", lambda rows: rows.pop(7), ["dropped 1 timestamp"]),
    "a text in a pose": ("ego_pose", lambda rows: rows[7].update(translation=["x", 0, 0]), ["dropped 1 translation"],),
    "a pose far away": ("ego_pose", lambda rows: rows[7].update(translation=[1e9, 0, 0]), ["dropped 1 translation"]),
    "a pose beside": ("ego_pose", lambda rows: rows[7].update(translation=[0, 0, 0]), ["dropped 1 translation"]),
    "the first pose": ("ego_pose", lambda rows: rows[0].update(rotation=None), ["dropped 1 translation, rotation"]),
    "unknown pose": ("sample_data", lambda rows: rows[7].update(ego_pose_token="f"), ["dropped 1 timestamp"]),
    "unknown lidar": (
        "sample_data",
        lambda rows: rows[7].update(calibrated_sensor_token=None),
        ["assumed 1 calibrated_sensor_token"],
    ),
    "no lidar": (
        "sensor",
        lambda rows: rows[0].update(channel=None),
        ["assumed 2"],
    ),
    "unnamed category": ("category", lambda rows: [row.update(name=7) for row in rows if row["name"] == "animal"], [
        "assumed 1 category_token"]),
}  # fmt: skip


def described(scenario: ScenarioDescription) -> list[str]:
    return [f"{defect.action} {defect.count} {defect.field}" for defect in scenario.defects]


@pytest.mark.parametrize("what", BAD_BOXES)
def test_bad_box_costs_that_box(raw: Path, written: Path, what: str) -> None:
    """The first rows are of the first object of scene-0061; all other states arrive unchanged."""
    change, reason = BAD_BOXES[what]
    edit(raw / "v1.0-mini" / "sample_annotation.json", lambda rows: rows[7].update(change))
    whole, scenario = (
        next(s for s in scenarios(CONVERTER, folder, "mini", frames="recorded") if s.source.scenario_id == "scene-0061")
        for folder in (written, raw)
    )
    defect = scenario.defects[0]
    assert (defect.table, defect.file, defect.action) == ("tracks", "v1.0-mini/sample_annotation.json", "dropped")
    assert (defect.location, defect.count) == ("row 7", 1)
    assert f"{defect.field}: {defect.reason}".startswith(reason)
    lost = np.argwhere(whole.tracks.valid & ~scenario.tracks.valid)
    assert lost.tolist() == [[0, 7]]
    for name in ("position", "heading", "size"):
        before, after = (getattr(each.tracks, name)[scenario.tracks.valid] for each in (whole, scenario))
        assert np.array_equal(before, after)


@pytest.mark.long
@pytest.mark.parametrize("what", BAD_ROWS)
def test_bad_row_costs_that_row(raw: Path, what: str) -> None:
    """The first rows of each table belong to the first scene, and are reported there."""
    table, change, wanted = BAD_ROWS[what]
    edit(raw / "v1.0-mini" / f"{table}.json", change)
    found = {s.source.scenario_id: s for s in scenarios(CONVERTER, raw, "mini")}
    assert set(found) == {"scene-0061", "scene-0103"}
    for scenario in found.values():
        scenario.validate()
        assert len(scenario.tracks) in (27, 28)
    found_of = described(found["scene-0061"])
    assert len(found_of) == len(wanted)
    assert all(line.startswith(start) for line, start in zip(found_of, wanted, strict=True))
    assert bool(described(found["scene-0103"])) == (table in ("sensor", "category"))
    assert (found["scene-0061"].map is None) == (what in ("unknown log", "no location"))


def test_scene_without_ego_is_quarantined(raw: Path) -> None:
    edit(raw / "v1.0-mini" / "sample_data.json", lambda rows: rows.__delitem__(slice(0, 400)))
    shard, other = reversed(shards(CONVERTER, raw, "mini"))
    (record,) = CONVERTER.records(shard)
    with pytest.raises(InvalidScenario, match=r"scene-0061: .*expected ego poses at the lidar sweeps"):
        CONVERTER.scenario(shard, record)
    assert len([CONVERTER.scenario(other, record) for record in CONVERTER.records(other)]) == 1


@pytest.mark.parametrize("name", [None, 5, "../scene", "", "scene-0103"])
def test_scene_without_a_name_of_its_own_is_passed_over(raw: Path, name: object) -> None:
    edit(raw / "v1.0-mini" / "scene.json", lambda rows: rows[0].update(name=name))
    assert len(scenarios(CONVERTER, raw, "mini")) == 1


@pytest.mark.parametrize("content", ["", "[]", "5"])
def test_damaged_prediction_list_is_named(raw: Path, content: str) -> None:
    path = raw / "maps" / "prediction" / "prediction_scenes.json"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(CorruptSource, match=r"prediction_scenes\.json: expected lists of"):
        scenarios(CONVERTER, raw, "mini", by="window")


def test_damaged_predictions_of_a_scene_are_named(raw: Path) -> None:
    path = raw / "maps" / "prediction" / "prediction_scenes.json"
    path.parent.mkdir()
    path.write_text('{"scene-0061": 5, "scene-0103": []}')
    with pytest.raises(InvalidScenario, match="prediction_scenes: expected a list of <instance>_<sample>"):
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


def change_path(content: dict[str, Any], **change: object) -> None:
    next(iter(content["arcline_path_3"].values()))[0].update(change)


BAD_FEATURES: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "a missing node": (lambda c: c["node"].__delitem__(5), "assumed"),
    "an infinite node": (lambda c: c["node"][3].update(x=float("inf")), "assumed"),
    "a distant node": (lambda c: c["node"][3].update(x=1e12), "assumed"),
    "a node in words": (lambda c: c["node"][3].update(y="north"), "assumed"),
    "a node that is none": (lambda c: c["node"].__setitem__(3, [1]), "assumed"),
    "a polygon of two nodes": (
        lambda c: c["polygon"][1].update(exterior_node_tokens=c["polygon"][1]["exterior_node_tokens"][:2]),
        "assumed",
    ),
    "an unknown shape of path": (lambda c: change_path(c, shape="LXL"), "assumed"),
    "a path of negative radius": (lambda c: change_path(c, radius=-1.0), "assumed"),
    "an unhashable segment": (
        lambda c: c["lane_divider"][0]["lane_divider_segments"][0].update(segment_type={}),
        "assumed",
    ),
    "links in words": (lambda c: next(iter(c["connectivity"].values())).update(incoming="all"), "assumed"),
    "an unknown line": (lambda c: c["lane_divider"][0].update(line_token="nowhere"), "dropped"),
    "an unknown polygon": (lambda c: c["walkway"][0].update(polygon_token="nowhere"), "dropped"),
    "a token twice": (lambda c: c["walkway"].append(c["walkway"][0]), "dropped"),
    "a record that is none": (lambda c: c["walkway"].append("path"), "dropped"),
    "a light nowhere": (lambda c: c["traffic_light"][0].update(pose=None), "dropped"),
    "a light in words": (lambda c: c["traffic_light"][0]["pose"].update(tx="x"), "dropped"),
    "a block as a list": (lambda c: c["stop_line"][0].update(road_block_token=[]), "dropped"),
}


@pytest.mark.long
@pytest.mark.parametrize("what", BAD_FEATURES)
def test_bad_map_feature_costs_that_feature(raw: Path, written: Path, what: str) -> None:
    change, action = BAD_FEATURES[what]
    name = "maps/expansion/boston-seaport.json"
    edit(raw / name, change)
    builder, whole = (read_map(folder / name, name) for folder in (raw, written))
    assert {(defect.table, defect.file, defect.action) for defect in builder.defects} == {("maps", name, action)}
    assert sum(defect.count for defect in builder.defects) <= 8  # features with the node
    assert abs(len(whole) - len(builder)) <= 5  # a divider is split into lines
    builder.build(np.zeros(3))
    assert len(scenarios(CONVERTER, raw, "mini")) == 2


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda content: content.pop("lane"), "no layer 'lane'"),
        (lambda content: content.update(connectivity=[]), "no layer 'connectivity'"),
        (lambda content: content.update(version="1.2"), "version '1.2'"),
        (lambda content: content.update(version=1.3), "no JSON object with a version"),
    ],
)
def test_other_map_fails_only_its_location(
    raw: Path, tmp_path: Path, change: Callable[[Any], object], found: str
) -> None:
    edit(raw / "maps" / "expansion" / "boston-seaport.json", change)
    report = convert("nuscenes", str(raw), tmp_path / "lake", split="mini")
    assert report.converted == 1
    assert len(report.failed) == 2  # the map, and the location's scenes
    reason = f"boston-seaport.json: expected a nuScenes map expansion v1.3, found {found}; download it again"
    assert all(reason in text for _, text in report.failed)
