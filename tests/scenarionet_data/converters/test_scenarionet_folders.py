"""Finding pickles of a database: nested folders, file names, mappings."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scenarionet_data import converters
from scenarionet_data.conversion import convert
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import ABSENT
from tests.fixtures import scenarionet_pickles as made

CONVERTER = ScenarioNetPickles()


def list_items(raw: Path) -> set[str]:
    return {item.name for shard in CONVERTER.shards(str(raw), "train", "v1", Options()) for item in shard.items}


def test_nested_folders_and_file_names(tmp_path: Path) -> None:
    raw = made.write_vintages(tmp_path)
    made.write_pickle({}, raw / "notes.pkl")
    assert list_items(raw) == {
        "waymo_0/sd_waymo_v1.2_a1.pkl",
        "waymo_0/sd_waymo_v1.2_a2.pkl",
        "old/sd_training.tfrecord-0_b1.pkl",
        "nu/0.pkl",
        "nu/1.pkl",
        "av2/sd_av2_v2_c1.pkl",
        "nuplan/sd_nuplan_v1.1_d1.pkl",
        "pg/deep/sd_pg_MetaDrive v0.4.3_PGMap-7.pkl",
        "moved/sd_waymo_v1.2_e1.pkl",
    }
    assert list_items(raw / "nu" / "0.pkl") == {"0.pkl"}


def test_mapping_determines_the_files(tmp_path: Path) -> None:
    made.write_vintages(tmp_path)
    virtual = tmp_path / "chosen"
    made.write_pickle({"sd_waymo_v1.2_a2.pkl": "../waymo_0", "1.pkl": "../nu"}, virtual / "dataset_mapping.pkl")
    made.write_pickle(made.waymo("z"), virtual / "sd_left_out.pkl")
    assert list_items(virtual) == {"../waymo_0/sd_waymo_v1.2_a2.pkl", "../nu/1.pkl"}
    (shard,) = CONVERTER.shards(str(virtual), "train", "v1", Options())
    assert {CONVERTER.scenario(shard, r).id for r in CONVERTER.records(shard)} == {
        "scenarionet/v1/waymo_a2",
        "scenarionet/v1/nuscenes_scene-0002",
    }


def test_wrong_folder_error_names_remedy(tmp_path: Path) -> None:
    with pytest.raises(SourceNotFound, match="give the folder with ScenarioNet pickles"):
        list_items(tmp_path / "nowhere")
    made.write_pickle({}, tmp_path / "other" / "notes.pkl")
    with pytest.raises(SourceNotFound, match=r"sd_\*\.pkl"):
        list_items(tmp_path / "other")
    made.write_pickle({"sd_gone.pkl": ""}, tmp_path / "virtual" / "dataset_mapping.pkl")
    with pytest.raises(SourceNotFound, match=r"sd_gone\.pkl"):
        list_items(tmp_path / "virtual")
    (tmp_path / "virtual" / "dataset_mapping.pkl").write_bytes(b"")
    with pytest.raises(CorruptSource, match="remove it to take every pickle"):
        list_items(tmp_path / "virtual")


def test_moved_folder_gives_equal_shards(tmp_path: Path) -> None:
    made.write_vintages(tmp_path / "first")
    shutil.copytree(tmp_path / "first", tmp_path / "second")
    keys = [
        [s.key("1") for s in CONVERTER.shards(str(tmp_path / n), "train", "v1", Options())] for n in ("first", "second")
    ]
    assert keys[0] == keys[1]


def test_converter_is_registered() -> None:
    assert isinstance(converters.get("scenarionet"), ScenarioNetPickles)


def test_unreadable_file_costs_its_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if it were missing: it is converted by a later run, when it can be read."""
    for name in ("a", "b"):
        made.write_pickle(made.waymo(name), tmp_path / f"sd_{name}.pkl")
    open_ = Path.open

    def refusing(path: Path, *arguments: object) -> object:
        if path.name == "sd_a.pkl":
            raise PermissionError(13, "Permission denied", str(path))
        return open_(path, *arguments)  # type: ignore[call-overload]

    monkeypatch.setattr(Path, "open", refusing)  # the tests may run as root, who may read everything
    (shard,) = CONVERTER.shards(str(tmp_path), "train", "v1", Options())
    assert [item.fingerprint == ABSENT for item in shard.items] == [True, False]
    with pytest.raises(InvalidScenario, match=r"sd_a\.pkl: pickle: cannot be read \(Permission denied\)"):
        CONVERTER.scenario(shard, shard.items[0])
    assert CONVERTER.scenario(shard, shard.items[1]).id == "scenarionet/v1/waymo_b"


@pytest.mark.parametrize("place", ["version", "map", "note", "scenario_id"])
def test_text_that_is_not_utf8_costs_its_scenario(tmp_path: Path, place: str) -> None:
    bad = made.waymo("bad")
    (bad if place == "version" else bad["metadata"])[place] = "x\udcff"
    if place == "scenario_id":
        bad["id"] = "x\udcff"
    made.write_pickle(bad, tmp_path / "raw" / "sd_bad.pkl")
    made.write_pickle(made.waymo("good"), tmp_path / "raw" / "sd_good.pkl")
    report = convert("scenarionet", tmp_path / "raw", tmp_path / "lake")
    assert (report.converted, report.quarantined, report.failed) == (1, 1, [])
