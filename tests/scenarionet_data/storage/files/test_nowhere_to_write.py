"""Full disks, missing permissions and files in place of folders: errors leave the lake unchanged."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import LakeError
from tests.fixtures.lakes import content, everything, write_lake
from tests.fixtures.made import raw_of, run, write_raw
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.small_disk import filled, in_own_mounts, on_small_disk
from tests.fixtures.waiting import HANGS_AFTER

pytestmark = pytest.mark.integration


@contextmanager
def as_user():
    """Drop privileges if the tests run as root, which ignores permissions."""
    if os.geteuid():
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.fixture
def open_folder():
    """A folder that every user may enter (pytest's temporary folders are private)."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    for path in folder.rglob("*"):
        if path.is_dir():
            path.chmod(0o755)
    shutil.rmtree(folder)


def test_converting_into_read_only_folder_raises_error(open_folder):
    """Conversion fails with a one-line error; reading still works."""
    raw, root = raw_of(open_folder / "raw", 0, 1), open_folder / "lake"
    run(raw, root)
    assert len(ScenarioLoader(root)[0].tracks) == 2  # compile now, while the kernel cache is writable
    raw_of(open_folder / "raw", 1, 1)
    for path in [root, *root.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = everything(root)
    with as_user():
        with pytest.raises(LakeError, match=r"^cannot write \S+: Permission denied; choose a writable folder"):
            run(raw, root)
        with pytest.raises(LakeError, match="Permission denied; choose a writable folder"):
            Lake(root).filter("true", name="all")
        assert len(Lake(root)) == 2
        assert len(ScenarioLoader(root)[0].tracks) == 2
    assert everything(root) == before


def test_creating_lake_in_read_only_folder_raises_error(open_folder):
    raw = raw_of(open_folder / "raw", 0, 1)
    open_folder.chmod(0o555)
    with as_user(), pytest.raises(LakeError, match="Permission denied; choose a writable folder"):
        run(raw, open_folder / "lake")


def test_reading_lake_without_permission_raises_error(open_folder):
    root = open_folder / "lake"
    write_lake(root, [make_scenario(1, num_objects=2)])
    (root / "snapshots").chmod(0o000)
    with as_user(), pytest.raises(LakeError, match=r"^cannot read \S+snapshots: Permission denied"):
        Lake(root)


@pytest.mark.parametrize("below", ["file", "file/lake"])
def test_creating_lake_in_place_of_file_raises_error(tmp_path, below):
    (tmp_path / "file").write_text("x")
    with pytest.raises(
        LakeError, match=r"^cannot write \S+: (Not a directory|File exists); choose a folder, not a file$"
    ):
        run(raw_of(tmp_path / "raw", 0, 1), tmp_path / below)
    assert (tmp_path / "file").read_text() == "x"


def fill_the_disk(disk: str, folder: str) -> dict:
    """Fill the disk so that a small shard fits but a large one does not; free the space later."""
    root, raw = Path(disk, "lake"), Path(folder, "raw")
    run(write_raw(raw, {"a": [1, 2]}), root)
    before = everything(root)
    write_raw(raw, {"b": list(range(10, 60)), "c": [70]})
    with filled(Path(disk), 200_000):
        try:
            run(raw, root)
            message = "no error"
        except LakeError as error:
            message = str(error)
        after = everything(root)
    report = run(raw, root)
    return {
        "message": message,
        "same": {k: after.get(k) for k in before} == before,
        "temporary": [k for k in after if k.startswith(".tmp")],
        "snapshots": [k for k in after if k.endswith(".json")],
        "converted": report.converted,
        "content": content(root),
    }


READ_ONLY = """
import json, sys
from pathlib import Path
from scenarionet_data import Lake, convert
from scenarionet_data.errors import LakeError
from tests.fixtures.made import NAME, MadeOptions
messages = []
for act in (
    lambda: convert(NAME, sys.argv[2], sys.argv[1], options=MadeOptions(num_objects=2)),
    lambda: Lake(sys.argv[1]).filter("true", name="all"),
):
    try:
        act()
        messages.append("no error")
    except LakeError as error:
        messages.append(str(error))
print(json.dumps({"messages": messages, "count": len(Lake(sys.argv[1]))}))
"""


@pytest.mark.long
def test_full_disk_leaves_lake_unchanged(tmp_path):
    found = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk", tmp_path)
    assert found["message"].startswith("cannot write /")
    assert found["message"].endswith(
        "No space left on device; free some space and run the same command again: finished shards are kept"
    )
    assert "\n" not in found["message"]
    assert found["same"]
    assert found["temporary"] == []
    assert found["snapshots"] == ["lake.json", "snapshots/00000001.json"]
    assert found["converted"] == 51
    run(tmp_path / "raw", tmp_path / "undisturbed")
    assert [tuple(pair) for pair in found["content"]] == content(tmp_path / "undisturbed")


@pytest.mark.long
def test_lake_on_read_only_file_system_is_readable(tmp_path):
    """Not even root can write to a read-only file system."""
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / "lake")
    raw_of(raw, 1, 1)
    lake = tmp_path / "lake"
    mounts = f"mount --bind '{lake}' '{lake}' && mount -o remount,bind,ro '{lake}'"
    found = in_own_mounts(mounts, READ_ONLY, lake, raw)
    for message in found["messages"]:
        assert message.startswith("cannot write ")
        assert "Read-only file system; choose a writable folder, or change its permissions" in message
    assert found["count"] == 2


LIMITED_FILES = """
import resource, sys
from scenarionet_data import convert
from scenarionet_data.errors import LakeError
from tests.fixtures.made import NAME, MadeOptions
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    convert(NAME, sys.argv[1], sys.argv[2], options=MadeOptions(num_objects=30))
except LakeError as error:
    print(error)
"""


def test_file_size_limit_leaves_lake_unchanged(tmp_path):
    """A file-size limit stands in for a full disk where nothing can be mounted."""
    run(raw_of(tmp_path / "raw", 0, 1), tmp_path / "lake")
    before = everything(tmp_path / "lake")
    more = raw_of(tmp_path / "more", 1, 1, lines=9)
    command = [sys.executable, "-c", LIMITED_FILES, str(more), str(tmp_path / "lake")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANGS_AFTER)
    assert done.stdout.count("\n") == 1, done.stderr
    assert "File too large; free some space and run the same command again" in done.stdout
    assert done.stderr == ""
    assert everything(tmp_path / "lake") == before
