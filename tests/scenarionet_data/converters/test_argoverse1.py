"""The Argoverse 1 converter as a whole: conformance, finding recordings and maps, bad input, conversion into a lake."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.converters.argoverse1 import Argoverse1, Argoverse1Options
from scenarionet_data.converters.splits import guess_split
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures import argoverse1 as fixture
from tests.fixtures.reading import scenarios, shards

CONVERTER = Argoverse1()


def write_dataset(root: Path, num_files: int = 3) -> Path:
    fixture.write_recordings(root / "train" / "data", num_files)
    fixture.write_map(root / "map_files")
    return root


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "raw")


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.csv"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        return write_dataset(folder / "raw")


class TestMaps(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.xml"
    split = "val"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_recordings(folder / "raw" / "val" / "data", 2, seed=1, city="MIA")
        fixture.write_map(folder / "raw", "MIA", has_heights=True)
        return folder / "raw"


@pytest.mark.long
class TestObservedOnly(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.csv"
    split = "test"
    options = {"has_map": False}  # noqa: RUF012

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        fixture.write_recordings(folder / "raw" / "test_obs" / "data", 2, num_frames=20)
        return folder / "raw"


# --- finding --------------------------------------------------------------------------------------------


def test_splits_are_distinguished(tmp_path: Path) -> None:
    for split, count in (("train", 3), ("val", 2), ("test_obs", 1)):
        fixture.write_recordings(tmp_path / split / "data", count)
    found = {s: shards(CONVERTER, tmp_path, s, has_map=False) for s in ("train", "val", "test")}
    assert {s: [len(shard.items) for shard in found[s]] for s in found} == {"train": [3], "val": [2], "test": [1]}
    ids = [s.id for split in found for s in scenarios(CONVERTER, tmp_path, split, has_map=False)]
    assert "argoverse1/v1.1/val-1" in ids
    assert len(set(ids)) == 6
    assert guess_split(str(tmp_path / "test_obs")) == "test"
    with pytest.raises(SourceNotFound, match=r"no such folder.*of split val"):
        shards(CONVERTER, tmp_path / "train" / "nothing", "val", has_map=False)


def test_maps_are_found_below_raw_or_in_the_given_folder(tmp_path: Path) -> None:
    raw = write_dataset(tmp_path / "raw")
    moved = tmp_path / "elsewhere"
    (raw / "map_files").rename(moved)
    with pytest.raises(SourceNotFound, match=r"pruned_argoverse_\*_vector_map.xml.*option maps.*has_map to false"):
        shards(CONVERTER, raw)
    (shard,) = shards(CONVERTER, raw, maps=str(moved))
    moved.rename(raw / "map_files")
    (same,) = shards(CONVERTER, raw)
    assert shard.key("1") == same.key("1")
    assert shards(CONVERTER, raw, has_map=False)[0].key("1") != same.key("1")
    (city,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    assert (city.name, city.split) == ("PIT-10314", "")
    assert list(CONVERTER.maps(str(raw), "v1.1", Argoverse1Options(has_map=False))) == []


def test_single_file_as_raw_path(raw: Path) -> None:
    (whole,) = [s for s in scenarios(CONVERTER, raw) if s.source.scenario_id == "2"]
    (alone,) = scenarios(CONVERTER, raw / "train" / "data" / "2.csv", maps=str(raw))
    assert alone.source.file == "2.csv"
    assert differences(alone.tracks, whole.tracks) == []


def test_map_added_later_changes_the_recordings(raw: Path) -> None:
    (before,) = shards(CONVERTER, raw)
    fixture.write_map(raw / "map_files", "MIA")
    (after,) = shards(CONVERTER, raw)
    assert before.key("1") != after.key("1")


def test_folders_without_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.csv"):
        shards(CONVERTER, tmp_path)
    (tmp_path / "table.csv").write_text("iteration,loss\n1,2\n")
    with pytest.raises(SourceNotFound, match="not Argoverse 1 recordings"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound):
        shards(CONVERTER, tmp_path / "nowhere")


@pytest.mark.parametrize("radius", [-1.0, float("nan"), 1e9])
def test_invalid_options_are_refused(radius: float) -> None:
    with pytest.raises(BadParameter):
        Argoverse1Options(radius=radius)


# --- bad input ------------------------------------------------------------------------------------------

Damage = Callable[[list[str]], list[str]]


def drop_tail(lines: list[str]) -> list[str]:
    return lines[: len(lines) // 2]


def no_ego(lines: list[str]) -> list[str]:
    return [line for line in lines if ",AV," not in line]


def no_city(lines: list[str]) -> list[str]:
    return [line.replace(",PIT", ",") for line in lines]


def another_header(lines: list[str]) -> list[str]:
    return ["TIME,TRACK_ID,OBJECT_TYPE,X,Y,CITY_NAME", *lines[1:]]


def only_header(lines: list[str]) -> list[str]:
    return lines[:1]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (drop_tail, "expected 20 or 50 times"),
        (no_ego, "expected rows of the ego"),
        (no_city, "expected a CITY_NAME"),
        (another_header, "line 1: expected the columns TIMESTAMP, .* found no TIMESTAMP"),
        (only_header, "expected rows"),
    ],
)
def test_files_without_ego_or_clock_are_refused_individually(raw: Path, damage: Damage, message: str) -> None:
    path = raw / "train" / "data" / "2.csv"
    path.write_text("\n".join(damage(path.read_text().splitlines())) + "\n")
    (shard,) = shards(CONVERTER, raw)
    refused = {}
    for record in CONVERTER.records(shard):
        try:
            CONVERTER.scenario(shard, record).validate()
        except InvalidScenario as error:
            refused[record.name] = str(error)
    assert list(refused) == ["train/data/2.csv"]
    assert re.search(message, refused["train/data/2.csv"])
    assert str(path) in refused["train/data/2.csv"]


def in_cell(name: str, value: str) -> Callable[[str], str]:
    """Replace the value of a column."""
    column = fixture.HEADER.split(",").index(name)

    def change(line: str) -> str:
        cells = line.split(",")
        return ",".join([*cells[:column], value, *cells[column + 1 :]])

    return change


@pytest.mark.parametrize(
    ("change", "field", "reason"),
    [
        (lambda line: line + ",?", "row", "expected 6 cells, found 7"),
        (in_cell("X", ""), "position", "expected finite metres, found no number"),
        (in_cell("Y", "nan"), "position", "expected finite metres"),
        (in_cell("X", "1e12"), "position", "expected a position within 10,000 m of the ego, found 1e+12"),
        (in_cell("X", "far"), "position", "expected finite metres"),
        (in_cell("TIMESTAMP", "1e12"), "TIMESTAMP", "expected a time within 60 s of the others"),
        (in_cell("TIMESTAMP", "late"), "TIMESTAMP", "expected a time within 60 s of the others"),
        (in_cell("TIMESTAMP", "315971500.00321"), "TIMESTAMP", "expected one of the 50 times"),
        (in_cell("TRACK_ID", ""), "TRACK_ID", "expected a track, found none"),
        (in_cell("CITY_NAME", "MIA"), "CITY_NAME", "expected PIT as in most rows"),
        (lambda line: line + "\n" + line, "TIMESTAMP", "expected one row for an object and time"),
    ],
)
def test_bad_row_costs_that_row(
    raw: Path, change: Callable[[str], str], field: str, reason: str, tmp_path: Path
) -> None:
    (shard,) = shards(CONVERTER, raw)
    whole = CONVERTER.scenario(shard, shard.items[1])
    path = raw / shard.items[1].name
    lines = path.read_text().splitlines()
    number = next(k for k in range(300, len(lines)) if ",OTHERS," in lines[k])
    time, name, *_ = lines[number].split(",")
    path.write_text("\n".join([*lines[:number], change(lines[number]), *lines[number + 1 :]]) + "\n")
    found = CONVERTER.scenario(shard, shard.items[1])
    found.validate()
    (defect,) = found.defects
    assert (defect.table, defect.file, defect.field, defect.action) == ("tracks", shard.items[1].name, field, "dropped")
    assert defect.reason.startswith(reason)
    line = number + 1 + (change(lines[number]).count("\n"))
    assert (defect.location, defect.count) == (f"row {line}", 1)
    row = whole.tracks.ids.tolist().index(name)
    frame = int(np.abs(whole.timestamps + fixture.FIRST_TIME - float(time)).argmin())
    lost = np.zeros_like(whole.tracks.valid)
    lost[row, frame] = "\n" not in change(lines[number])
    kept = [whole.tracks.ids.tolist().index(track) for track in found.tracks.ids]
    assert (found.tracks.valid == (whole.tracks.valid & ~lost)[kept]).all()
    assert (found.tracks.position == np.where(lost[..., None], 0, whole.tracks.position)[kept]).all()


def test_lost_row_of_the_ego_is_interpolated_and_flagged(raw: Path) -> None:
    (shard,) = shards(CONVERTER, raw)
    whole = CONVERTER.scenario(shard, shard.items[0])
    path = raw / shard.items[0].name
    lines = path.read_text().splitlines()
    number = [k for k, line in enumerate(lines) if ",AV," in line][19]
    path.write_text("\n".join([*lines[:number], in_cell("X", "?")(lines[number]), *lines[number + 1 :]]) + "\n")
    found = CONVERTER.scenario(shard, shard.items[0])
    found.validate()
    ego = found.ego_index
    assert np.flatnonzero(found.tracks.is_interpolated[ego]).tolist() == [19]
    assert found.tracks.is_interpolated.sum() == 1
    assert np.abs(found.tracks.position[ego] - whole.tracks.position[ego]).max() < 0.1
    assert [(defect.action, defect.count) for defect in found.defects] == [("dropped", 1), ("assumed", 1)]


def test_roles_that_contradict_are_assumed(raw: Path) -> None:
    (shard,) = shards(CONVERTER, raw)
    path = raw / shard.items[0].name
    text = path.read_text()
    path.write_text(text.replace(",OTHERS,", ",AGENT,", 3).replace(",AV,", ",?,", 2))
    found = CONVERTER.scenario(shard, shard.items[0])
    found.validate()
    (defect,) = found.defects
    assert (defect.action, defect.field, defect.count) == ("assumed", "OBJECT_TYPE", 5)
    assert len(found.objects_of_interest) == 1
    path.write_text(text.replace(",AGENT,", ",OTHERS,"))
    assert CONVERTER.scenario(shard, shard.items[0]).tracks_to_predict == ()


def test_city_without_a_map_is_quarantined_and_the_rest_continues(raw: Path, tmp_path: Path) -> None:
    fixture.write_recordings(raw / "train" / "data" / "more", 1, city="MIA")
    report = convert("argoverse1", str(raw), tmp_path / "lake", split="train")
    assert (report.converted, report.quarantined, report.failed) == (3, 1, [])
    (row,) = Lake(tmp_path / "lake").sql("SELECT * FROM quarantine").to_dicts()
    assert "pruned_argoverse_MIA_*_vector_map.xml" in row["message"]
    assert "has_map to false" in row["message"]


@pytest.mark.parametrize(
    ("old", "new", "field", "reason"),
    [
        ('<nd ref="7" />', '<nd ref="123456" />', "nd", "expected nodes of the file, found 123456"),
        ('v="False"', 'v="Perhaps"', "has_traffic_control", "expected True or False, found Perhaps"),
        ('lane_id="9600010"', 'lane_id="9600000"', "lane_id", "expected an id that no other lane has"),
        ('lane_id="9600010"', 'lane_id="x"', "lane_id", "expected the number of a lane, found x"),
        ('k="l_neighbor_id"', 'k="neighbor"', "l_neighbor_id", "expected the number of a lane, found none"),
        ('<node id="3" x="', '<node id="3" x="a', "node", "expected finite metres, found no number"),
        ('<node id="3" x="', '<node id="3" x="nan" z="', "node", "expected finite metres, found no number"),
        ('<node id="3" x="', '<node id="3" x="1e9" z="', "node", "expected points within 200,000 m"),
    ],
)
def test_bad_lane_costs_that_lane(raw: Path, old: str, new: str, field: str, reason: str) -> None:
    path = raw / "map_files" / fixture.map_name("PIT")
    (city,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    whole = CONVERTER.map_features(city).build(np.zeros(3))
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    features = CONVERTER.map_features(city)
    (defect,) = features.defects
    assert (defect.table, defect.file, defect.field, defect.count) == ("maps", path.name, field, 1)
    assert defect.reason.startswith(reason)
    found = features.build(np.zeros(3))
    assert len(found) == len(whole) - 1
    rows = [whole.ids.tolist().index(lane) for lane in found.ids]
    assert (found.polyline.values == whole.take(np.array(rows)).polyline.values).all()


@pytest.mark.parametrize(("old", "new", "message"), [("way", "road", "no lane"), ("</way>", "", "mismatched tag")])
def test_maps_that_are_none_are_named(raw: Path, old: str, new: str, message: str) -> None:
    path = raw / "map_files" / fixture.map_name("PIT")
    path.write_text(path.read_text().replace(old, new))
    (city,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    with pytest.raises(CorruptSource, match=message) as caught:
        CONVERTER.map_features(city)
    assert str(path) in str(caught.value)


def test_folder_in_place_of_a_map_is_named(raw: Path) -> None:
    path = raw / "map_files" / fixture.map_name("PIT")
    path.unlink()
    path.mkdir()
    for listing in (shards, lambda converter, folder: list(converter.maps(str(folder), "v1.1", Argoverse1Options()))):
        with pytest.raises(SourceNotFound, match="expected a map, found a folder; download the HD maps again"):
            listing(CONVERTER, raw)


def test_files_that_are_not_read_are_listed(raw: Path) -> None:
    (raw / "map_files" / "PIT_10314_driveable_area_mat_2019_05_28.npy").write_bytes(b"")
    fixture.write_recordings(raw / "val" / "data", 2)
    options = Argoverse1Options()
    listed = list(CONVERTER.passed_over(str(raw), "train", options, shards(CONVERTER, raw)))
    assert [(each.count, each.reason) for each in listed] == [
        (2, "of another split than train"),
        (1, "not read by this converter"),
    ]


def test_entity_expansion_in_maps_is_refused(raw: Path) -> None:
    path = raw / "map_files" / fixture.map_name("PIT")
    levels = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 20}">' for k in range(1, 9))
    path.write_text(f'<!DOCTYPE x [<!ENTITY a0 "aaaaaaaaaaaaaaaaaaaa">{levels}]><x>&a8;</x>')
    (city,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    with pytest.raises(CorruptSource):
        CONVERTER.map_features(city)


# --- into a lake ----------------------------------------------------------------------------------------


def test_city_map_is_stored_once_and_scenarios_load_their_crop(raw: Path, tmp_path: Path) -> None:
    report = convert("argoverse1", str(raw), tmp_path / "lake", split="train")
    assert report.is_clean
    assert report.converted == 3
    lake = Lake(tmp_path / "lake")
    given = {s.id: s for s in scenarios(CONVERTER, raw)}
    rows = lake.sql("SELECT scenario_id, map_id, maps_file FROM metadata").to_dicts()
    assert {(row["map_id"], row["maps_file"]) for row in rows} == {("PIT-10314", None)}
    for scenario in ScenarioLoader(lake):
        assert differences(scenario.tracks, given[scenario.id].tracks) == []
        stored, wanted = scenario.map, given[scenario.id].map
        assert stored is not None
        assert wanted is not None
        assert stored.ids.tolist() == wanted.ids.tolist()
        np.testing.assert_allclose(stored.polyline.values, wanted.polyline.values, atol=2e-4)
        assert stored.extras.tolist() == wanted.extras.tolist()
    assert convert("argoverse1", str(raw), tmp_path / "lake", split="train").skipped == 1
