"""The Argoverse 1 converter as a whole: conformance, finding recordings and maps, bad input, conversion into a lake."""

from __future__ import annotations

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


def corrupt_row(lines: list[str]) -> list[str]:
    return [*lines[:40], lines[40].replace(",AV,", ",AV,?").replace(",OTHERS,", ",OTHERS,?"), *lines[41:]]


def empty_cell(lines: list[str]) -> list[str]:
    cells = lines[40].split(",")
    return [*lines[:40], ",".join([*cells[:3], "", *cells[4:]]), *lines[41:]]


def not_a_number(lines: list[str]) -> list[str]:
    cells = lines[40].split(",")
    return [*lines[:40], ",".join([*cells[:3], "nan", *cells[4:]]), *lines[41:]]


def repeat_row(lines: list[str]) -> list[str]:
    return [*lines[:40], lines[39], *lines[40:]]


def second_city(lines: list[str]) -> list[str]:
    return [*lines[:40], lines[40].replace("PIT", "MIA"), *lines[41:]]


def second_agent(lines: list[str]) -> list[str]:
    return [line.replace("OTHERS", "AGENT") for line in lines]


def changing_type(lines: list[str]) -> list[str]:
    return [*lines[:200], *(line.replace("AGENT", "OTHERS") for line in lines[200:])]


def no_ego(lines: list[str]) -> list[str]:
    return [line for line in lines if ",AV," not in line]


def only_header(lines: list[str]) -> list[str]:
    return lines[:1]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (drop_tail, "expected 20 or 50 times"),
        (corrupt_row, "cannot be read"),
        (empty_cell, "column X"),
        (not_a_number, "column X"),
        (repeat_row, "two rows with the same time"),
        (second_city, "expected one CITY_NAME"),
        (second_agent, "expected one AGENT"),
        (changing_type, "changes its OBJECT_TYPE"),
        (no_ego, "expected one AV"),
        (only_header, "expected rows"),
    ],
)
def test_damaged_recordings_are_refused_individually(raw: Path, damage: Damage, message: str) -> None:
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
    assert message in refused["train/data/2.csv"]
    assert str(path) in refused["train/data/2.csv"]


def test_city_without_a_map_is_quarantined_and_the_rest_continues(raw: Path, tmp_path: Path) -> None:
    fixture.write_recordings(raw / "train" / "data" / "more", 1, city="MIA")
    report = convert("argoverse1", str(raw), tmp_path / "lake", split="train")
    assert (report.converted, report.quarantined, report.failed) == (3, 1, [])
    (row,) = Lake(tmp_path / "lake").sql("SELECT * FROM quarantine").to_dicts()
    assert "pruned_argoverse_MIA_*_vector_map.xml" in row["message"]
    assert "has_map to false" in row["message"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<nd ref="7" />', '<nd ref="123456" />', "node 123456, which the file lacks"),
        ('v="False"', 'v="Perhaps"', "expected True or False"),
        ('lane_id="9600010"', 'lane_id="9600000"', "ids"),
        ('k="l_neighbor_id"', 'k="neighbor"', "l_neighbor_id"),
        ('<node id="3" x="', '<node id="3" x="a', "could not convert"),
        ('<node id="3" x="', '<node id="3" x="nan" z="', "unknown coordinates"),
        ("way", "road", "0 lanes"),
        ("</way>", "", "mismatched tag"),
    ],
)
def test_damaged_maps_are_named(raw: Path, old: str, new: str, message: str) -> None:
    path = raw / "map_files" / fixture.map_name("PIT")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1 if old != "way" else -1))
    (city,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    with pytest.raises(CorruptSource, match=message) as caught:
        CONVERTER.map_features(city)
    assert str(path) in str(caught.value)


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
