"""Files that cannot be read, listed or named: one sentence each."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from scenarionet_data.converters.base import find_files
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.listing import walk
from scenarionet_data.ingest.shard import RawItem, fingerprint

NOT_UTF8 = os.fsdecode(b"caf\xe9.csv")


def test_name_that_is_not_utf8_is_refused():
    with pytest.raises(
        CorruptSource, match=r"^logs/caf\\udce9\.csv: the name is not UTF-8; rename the file or folder$"
    ):
        RawItem(f"logs/{NOT_UTF8}", "f")


@pytest.mark.parametrize(("target", "reason"), [("itself", "Too many levels"), ("nowhere", "No such file")])
def test_link_that_leads_nowhere_is_named(tmp_path, target, reason):
    (tmp_path / "itself").symlink_to(tmp_path / target)
    with pytest.raises(CorruptSource, match=rf"itself: cannot be read \({reason}.*; repair or remove it"):
        fingerprint([tmp_path / "itself"])


def test_looping_folders_are_listed_once(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in/1.csv").write_text("x")
    (tmp_path / "in/loop").symlink_to(tmp_path)
    assert find_files(str(tmp_path), "*.csv", "recordings") == [tmp_path / "in/1.csv"]


def test_folder_that_cannot_be_listed_is_named(tmp_path, monkeypatch):
    (tmp_path / "closed").mkdir()
    scandir = os.scandir

    def refusing(path):
        if Path(path).name == "closed":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refusing)  # the tests may run as root, who may read everything
    with pytest.raises(CorruptSource, match=r"closed: cannot be listed \(Permission denied\); change its permissions"):
        list(walk(tmp_path))
