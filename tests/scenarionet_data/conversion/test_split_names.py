"""Spelling of ``split``: names of the dataset's folders are accepted, the lake stores its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import plan_conversion
from tests.fixtures import waymo
from tests.fixtures.made import run, write_raw


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset with one scenario in each of two splits."""
    for seed, split in enumerate(("training", "validation"), start=1):
        folder = tmp_path / "waymo" / split / "part"
        waymo.write_tfrecord(folder / f"{split}.tfrecord-00000-of-00001", [waymo.scenario_bytes(seed)])
    return tmp_path / "waymo"


@pytest.mark.parametrize("split", ["val", "validation", "Validation"])
@pytest.mark.parametrize("folder", ["", "validation", "validation/part"])
def test_every_spelling_selects_the_split_in_every_folder(dataset: Path, folder: str, split: str) -> None:
    (shard,) = plan_conversion("waymo", dataset / folder, dataset.parent / "lake", split=split).shards
    assert shard.split == "val"
    assert shard.items[0].name.endswith("validation.tfrecord-00000-of-00001")


@pytest.mark.parametrize("split", ["training_20s", "validation_interactive", "testing_interactive"])
@pytest.mark.parametrize("is_inside", [False, True])
def test_every_folder_of_waymo_is_selected_by_its_name(dataset: Path, split: str, is_inside: bool) -> None:
    name = f"{split}.tfrecord-00000-of-00001"
    waymo.write_tfrecord(dataset / split / name, [waymo.scenario_bytes(3)])
    raw = dataset / split if is_inside else dataset
    for given in (split, None) if is_inside else (split,):
        (shard,) = plan_conversion("waymo", raw, dataset.parent / "lake", split=given).shards
        assert shard.split == {"training_20s": "train"}.get(split, split)
        assert shard.items[0].name.endswith(name)


def test_a_second_run_with_the_other_spelling_converts_nothing(dataset: Path, tmp_path: Path) -> None:
    report = convert("waymo", dataset, tmp_path / "lake", split="validation")
    assert report.partitions == {("waymo", "v1.2", "val")}
    again = convert("waymo", dataset, tmp_path / "lake", split="val")
    assert (again.converted, again.skipped, again.failed) == (0, 1, [])


def test_a_lake_with_the_other_spelling_keeps_it(
    raw: Path, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_raw(raw, {"a": [1]})
    with monkeypatch.context() as earlier:
        earlier.setattr("scenarionet_data.conversion.driver.lake_spelling", str)
        run(raw, root, split="training")
    write_raw(raw, {"a": [1], "b": [2]})
    report = run(raw, root, split="training")
    assert (report.converted, report.skipped, report.failed) == (1, 1, [])
    assert Lake(root).sql("SELECT DISTINCT split FROM metadata").rows() == [("training",)]
