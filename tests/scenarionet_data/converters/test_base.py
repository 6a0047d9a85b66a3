"""Guessing the split of a raw folder, and finding the files of a split."""

from __future__ import annotations

import pytest

from scenarionet_data.converters.base import find_files
from scenarionet_data.converters.splits import guess_split
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
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.made of split train"):
        find_files(str(raw / "motion"), "*.made", "made files", "train")
