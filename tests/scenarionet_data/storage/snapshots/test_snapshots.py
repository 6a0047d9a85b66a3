"""Snapshots and files: errors name damaged files, published snapshots persist."""

from __future__ import annotations

import json
import os
import threading
import time

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import LakeError, NoSuchSnapshot
from scenarionet_data.storage.integrity import seals
from tests.fixtures.lakes import write_lake


def test_folder_without_lake_raises_error(tmp_path):
    with pytest.raises(NoSuchSnapshot, match="no lake there; make one with"):
        Lake(tmp_path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        Lake(tmp_path / "file")


def test_missing_snapshot_error_lists_existing_snapshots(tmp_path, template):
    write_lake(tmp_path, [template])
    with pytest.raises(NoSuchSnapshot, match=r"no snapshot 7; there are 1 \.\.\. 1"):
        Lake(tmp_path, snapshot=7)


@pytest.mark.parametrize(
    "garbage", [b"", b"{", b"[]", b"7", b'{"format": 1}', b'{"format": 1, "colour": 3}', bytes(range(256))]
)
def test_damaged_snapshot_error_names_remedy(tmp_path, template, garbage):
    lake = write_lake(tmp_path, [template])
    path = tmp_path / "snapshots" / "00000002.json"
    path.write_bytes(garbage)
    with pytest.raises(LakeError, match=r"00000002\.json: damaged.*remove it to go back"):
        Lake(tmp_path)
    assert len(Lake(tmp_path, snapshot=1)) == 1
    path.unlink()
    assert Lake(tmp_path).snapshot == lake.snapshot


def test_snapshot_of_newer_format_asks_for_update(tmp_path, template):
    write_lake(tmp_path, [template])
    path = tmp_path / "snapshots" / "00000001.json"
    path.write_text(json.dumps({"format": seals.FORMAT + 1, "number": 1}))
    with pytest.raises(NoSuchSnapshot, match="newer version of this software; update it"):
        Lake(tmp_path)


def test_other_files_in_snapshots_folder_are_ignored(tmp_path, template):
    write_lake(tmp_path, [template])
    (tmp_path / "snapshots" / "notes.json").write_text("{}")
    (tmp_path / "snapshots" / "00000001.json~").write_text("{")
    assert Lake(tmp_path).snapshot.number == 1


def test_only_one_writer_publishes_a_snapshot_name(files):
    winners = []

    def publish(k):
        if files.publish_new("snapshots/x", str(k).encode()):
            winners.append(k)

    threads = [threading.Thread(target=publish, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(winners) == 1
    assert files.path("snapshots/x").read_text() == str(winners[0])
    assert not list((files.root / ".tmp").iterdir())


def test_sweep_removes_only_old_temporary_files(files):
    old, new = files.temporary(), files.temporary()
    for path in (old, new):
        path.write_bytes(b"x")
    os.utime(old, (0, time.time() - 25 * 3600))
    files.sweep()
    assert not old.exists()
    assert new.exists()


def test_refused_write_leaves_no_temporary_file(files):
    (files.root / "tracks").mkdir(parents=True)
    (files.root / "tracks" / "taken").mkdir()
    temporary = files.temporary()
    temporary.write_bytes(b"x")
    with pytest.raises(LakeError, match=r"cannot write .*taken: Is a directory"):
        files.publish(temporary, "tracks/taken")
    assert not temporary.exists()
