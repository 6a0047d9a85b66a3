"""Guessing the split of a raw folder, and finding the files of a split."""

from __future__ import annotations

import pytest

from scenarionet_data import converters
from scenarionet_data.converters.base import find_files
from scenarionet_data.converters.splits import ACCEPTED, guess_split, lake_spelling, split_folder
from scenarionet_data.errors import BadParameter, SourceNotFound


@pytest.fixture
def raw(tmp_path):
    for folder in ("motion/validation/a", "motion/validation/b", "other"):
        (tmp_path / "dataset" / folder).mkdir(parents=True)
        (tmp_path / "dataset" / folder / "x.made").touch()
    return tmp_path / "dataset"


def test_split_is_guessed_from_path_or_only_split_folder(raw):
    assert guess_split(str(raw / "motion/validation/a")) == "val"
    assert guess_split(str(raw)) == "val"
    assert guess_split("0:200") == "train"


def test_several_split_folders_require_a_choice(raw):
    (raw / "training").mkdir()
    with pytest.raises(BadParameter, match=r"contains the splits train, val; choose one, for example split='train'"):
        guess_split(str(raw))
    assert guess_split(str(raw / "training")) == "train"


def test_files_of_another_split_are_excluded(raw):
    names = [path.relative_to(raw).as_posix() for path in find_files(str(raw), "*.made", "made files", "val")]
    assert names == ["motion/validation/a/x.made", "motion/validation/b/x.made", "other/x.made"]
    names = [path.relative_to(raw).as_posix() for path in find_files(str(raw), "*.made", "made files", "train")]
    assert names == ["other/x.made"]
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.made of split train in it; it has the splits val$"):
        find_files(str(raw / "motion"), "*.made", "made files", "train")


def test_splits_are_found_by_the_names_of_the_datasets_folders(raw):
    (raw / "motion/training").mkdir()
    (raw / "motion/training/y.made").touch()
    for split in ("val", "validation", "VALIDATION"):
        found = find_files(str(raw / "motion"), "*.made", "made files", split)
        assert [path.parent.parent.name for path in found] == ["validation", "validation"]
    assert [path.name for path in find_files(str(raw / "motion"), "*.made", "made files", "training")] == ["y.made"]


@pytest.mark.parametrize("name", ["train", "val", "test", "mini"])
def test_the_lakes_names_of_splits_are_unchanged(name):
    assert lake_spelling(name) == name


def test_other_names_of_splits_are_unchanged():
    assert lake_spelling("validation_interactive") == "validation_interactive"
    assert lake_spelling("v1.0-trainval") == "v1.0-trainval"


@pytest.mark.parametrize("name", ["validation_interactive", "testing_interactive"])
def test_interactive_scenarios_are_splits_of_their_own(raw, name):
    (raw / f"motion/{name}").mkdir()
    (raw / f"motion/{name}/y.made").touch()
    assert guess_split(str(raw / "motion" / name)) == name
    assert [path.name for path in find_files(str(raw / "motion"), "*.made", "made files", name)] == ["y.made"]
    found = find_files(str(raw / "motion"), "*.made", "made files", "val")
    assert {path.parent.parent.name for path in found} == {"validation"}


def test_one_of_two_folders_of_a_split_is_selected_by_its_name(raw):
    (raw / "motion/training_20s").mkdir()
    assert split_folder(str(raw), "train") == str(raw)
    (raw / "motion/training").mkdir()
    for name in ("training", "training_20s"):
        assert split_folder(str(raw), name) == str(raw / "motion" / name)
        assert split_folder(str(raw / "motion" / name), name) == str(raw / "motion" / name)
    assert split_folder(str(raw), "validation") == str(raw)
    with pytest.raises(BadParameter, match="contains the folders training and training_20s, all of them split train"):
        split_folder(str(raw), "train")


def test_accepted_names_of_splits():
    assert ACCEPTED.keys() == set(converters.names()) - {"logical", "pg", "scenarionet"}
    assert {lake_spelling(name) for names in ACCEPTED.values() for name in names} == {
        "train", "val", "test", "mini", "mini_train", "mini_val", "train_val",
        "validation_interactive", "testing_interactive",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("alias", "name"), [("av1", "argoverse1"), ("av2", "argoverse2"), ("nuscenes-mini", "nuscenes")]
)
def test_names_that_people_type_are_understood(alias, name):
    assert type(converters.get(alias)) is type(converters.get(name))
    assert alias not in converters.names()
