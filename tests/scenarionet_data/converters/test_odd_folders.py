"""Raw folders with links and names as no one wants them: every converter lists them or says what is wrong."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from scenarionet_data.conversion import plan_conversion
from scenarionet_data.errors import ScenarioNetError
from tests.fixtures.datasets import WRITERS

pytestmark = pytest.mark.long

NOT_UTF8 = os.fsdecode(b"b\xff\xfe")


def _folders(raw):
    return sorted({path.parent for path in raw.rglob("*") if path.is_file()} | {raw})


def _largest(folder):
    return max((path for path in folder.rglob("*") if path.is_file()), key=lambda path: path.stat().st_size)


def loop(raw):
    for folder in _folders(raw):
        (folder / "loop").symlink_to(folder)


def links_to_each_other(raw):
    for folder in _folders(raw):
        (folder / "one").symlink_to(folder / "two")
        (folder / "two").symlink_to(folder / "one")


def link_to_itself(raw):
    for folder in _folders(raw):
        link = folder / f"x{_largest(folder).name}"
        link.symlink_to(link)


def dangling_link(raw):
    for folder in _folders(raw):
        (folder / f"y{_largest(folder).name}").symlink_to(folder / "nowhere")


def file_becomes_a_loop(raw):
    file = _largest(raw)
    file.unlink()
    file.symlink_to(file)


def file_becomes_a_folder(raw):
    file = _largest(raw)
    file.unlink()
    file.mkdir()


def file_becomes_empty(raw):
    _largest(raw).write_bytes(b"")


def name_ends_in_other_bytes(raw):
    for folder in _folders(raw):
        file = _largest(folder)
        shutil.copy(file, folder / f"{file.stem}{NOT_UTF8}{file.suffix}")


def name_begins_with_other_bytes(raw):
    for folder in _folders(raw):
        shutil.copy(_largest(folder), folder / f"sd_{NOT_UTF8}{_largest(folder).name}")


def folder_of_other_bytes(raw):
    shutil.copytree(raw, raw.parent / "copy", symlinks=True)
    (raw.parent / "copy").rename(raw / NOT_UTF8)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """RAW of each dataset, and the folder that contains it."""
    found = {}
    for name in set(WRITERS) - {"pg"}:
        folder = tmp_path_factory.mktemp(name)
        found[name] = folder, Path(WRITERS[name][0](folder))
    return found


ODD = [
    loop, links_to_each_other, link_to_itself, dangling_link, file_becomes_a_loop, file_becomes_a_folder,
    file_becomes_empty, name_ends_in_other_bytes, name_begins_with_other_bytes, folder_of_other_bytes,
]  # fmt: skip


@pytest.mark.parametrize("name", sorted(set(WRITERS) - {"pg"}))
@pytest.mark.parametrize("make_odd", ODD)
def test_folder_is_listed_or_one_sentence_says_why_not(written, tmp_path, name, make_odd):
    folder, raw = written[name]
    shutil.copytree(folder, tmp_path / "raw", symlinks=True)
    raw = tmp_path / "raw" / raw.relative_to(folder)
    make_odd(raw)
    try:
        assert plan_conversion(name, raw, tmp_path / "lake", split=WRITERS[name][1]).shards
    except ScenarioNetError as error:
        assert "\n" not in str(error)
        assert "; " in str(error)  # the remedy
