"""What the world does to a lake: killed processes, two jobs at once, full disks, read-only folders, damaged files.

Whatever happens, the lake stays as it was or becomes what an undisturbed run would have made.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import LakeError, SchemaMismatch, WorkerLost
from scenarionet_data.store.files import LakeFiles, sha256
from tests.fixtures.lakes import content, write_lake
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.small_disk import filled, in_own_mounts, on_small_disk

FEW = MadeOptions(num_objects=2)

CONVERT = """
import sys
from scenarionet_data import convert
from tests.fixtures.made import NAME, MadeOptions
if __name__ == "__main__":
    report = convert(NAME, sys.argv[1], sys.argv[2], options=MadeOptions(num_objects=2))
    print(report.converted, report.failed)
"""


def run(raw, root, **how):
    return convert(NAME, str(raw), root, **({"options": FEW} | how))


def start(raw, root):
    return subprocess.Popen([sys.executable, "-c", CONVERT, str(raw), str(root)], stdout=subprocess.PIPE, text=True)


def everything(root):
    """Every file below a folder, with its content."""
    return {str(p.relative_to(root)): sha256(p) for p in Path(root).rglob("*") if p.is_file()}


def raw_of(folder, first, count, lines=2):
    """``count`` shards of ``lines`` scenarios each."""
    return write_raw(folder, {f"s{first + k:03d}": [(first + k) * 10 + i for i in range(lines)] for k in range(count)})


# --- killed -------------------------------------------------------------------------------------------


def test_a_killed_job_loses_the_shard_in_work_at_most(tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [f"{k * 10 + i} slow" for i in range(4)] for k in range(5)})
    job = start(raw, tmp_path / "lake")
    deadline = time.monotonic() + 60
    while len(list(tmp_path.glob("lake/metadata/**/*.parquet"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    job.send_signal(signal.SIGKILL)
    job.communicate()
    assert job.returncode == -signal.SIGKILL
    finished = len(list(tmp_path.glob("lake/metadata/**/*.parquet")))
    assert 2 <= finished < 5
    report = run(raw, tmp_path / "lake")
    assert report.adopted == finished
    assert report.converted == 20
    run(raw, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")


@pytest.mark.long
def test_a_killed_worker_ends_the_run_and_keeps_what_was_finished(tmp_path):
    raw = raw_of(tmp_path / "raw", 0, 12)

    def kill(done, *_):
        if done == 3:
            multiprocessing.active_children()[0].kill()

    with pytest.raises(WorkerLost, match="run the same command again, with fewer --workers: what is finished is kept"):
        run(raw, tmp_path / "lake", workers=2, on_progress=kill)
    assert len(Lake(tmp_path / "lake")) >= 6
    report = run(raw, tmp_path / "lake")
    assert report.skipped >= 3
    run(raw, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")


# --- two at once --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["the same recordings", pytest.param("different recordings", marks=pytest.mark.long)])
def test_two_jobs_at_once_make_one_lake(tmp_path, kind):
    first = raw_of(tmp_path / "first", 0, 8)
    second = first if kind == "the same recordings" else raw_of(tmp_path / "second", 50, 8)
    jobs = [start(raw, tmp_path / "lake") for raw in (first, second)]
    outputs = [job.communicate(timeout=60)[0] for job in jobs]
    assert [job.returncode for job in jobs] == [0, 0]
    # Of the same recordings, the job that comes late converts what is left, or nothing.
    assert all(re.fullmatch(r"\d+ \[\]\n", output) for output in outputs)
    assert sum(int(output.split()[0]) for output in outputs) >= 16
    run(first, tmp_path / "undisturbed")
    run(second, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")
    ids = Lake(tmp_path / "lake").sql("SELECT scenario_id FROM metadata")["scenario_id"]
    assert ids.n_unique() == len(ids) == len({*first.iterdir(), *second.iterdir()}) * 2


# --- nowhere to write ---------------------------------------------------------------------------------


@contextmanager
def as_user():
    """Acts as somebody without rights where the tests run as root, which ignores permissions."""
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
    """A folder that everybody may enter: pytest's own are private."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    yield folder
    for path in folder.rglob("*"):
        if path.is_dir():
            path.chmod(0o755)
    shutil.rmtree(folder)


def test_a_folder_that_may_not_be_written(open_folder):
    """Converting more is refused in one line; reading goes on."""
    raw, root = raw_of(open_folder / "raw", 0, 1), open_folder / "lake"
    run(raw, root)
    raw_of(open_folder / "raw", 1, 1)
    for path in [root, *root.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    before = everything(root)
    with as_user():
        with pytest.raises(LakeError, match=r"^cannot write \S+: Permission denied; choose a folder you may write to"):
            run(raw, root)
        with pytest.raises(LakeError, match="Permission denied; choose a folder"):
            Lake(root).filter("true", name="all")
        assert len(Lake(root)) == 2
        assert len(ScenarioLoader(root)[0].tracks) == 2
    assert everything(root) == before


def test_a_folder_in_which_no_lake_can_be_made(open_folder):
    raw = raw_of(open_folder / "raw", 0, 1)
    open_folder.chmod(0o555)
    with as_user(), pytest.raises(LakeError, match="Permission denied; choose a folder you may write to"):
        run(raw, open_folder / "lake")


def test_a_lake_that_may_not_be_read(open_folder):
    root = open_folder / "lake"
    write_lake(root, [make_scenario(1, num_objects=2)])
    (root / "snapshots").chmod(0o000)
    with as_user(), pytest.raises(LakeError, match=r"^cannot read \S+snapshots: Permission denied"):
        Lake(root)


@pytest.mark.parametrize("below", ["file", "file/lake"])
def test_a_lake_in_the_place_of_a_file(tmp_path, below):
    (tmp_path / "file").write_text("x")
    with pytest.raises(
        LakeError, match=r"^cannot write \S+: (Not a directory|File exists); choose a folder, not a file$"
    ):
        run(raw_of(tmp_path / "raw", 0, 1), tmp_path / below)
    assert (tmp_path / "file").read_text() == "x"


def fill_the_disk(disk: str, folder: str) -> dict:
    """Leaves what a small shard needs but a large one does not find; later, room."""
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


def test_a_full_disk_leaves_the_lake_as_it_was(tmp_path):
    found = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk", tmp_path)
    assert found["message"].startswith("cannot write /")
    assert found["message"].endswith(
        "No space left on device; free some space and run the same command again: finished shards are kept"
    )
    assert "\n" not in found["message"]
    assert found["same"]
    assert found["temporary"] == []
    assert found["snapshots"] == ["snapshots/00000001.json"]
    assert found["converted"] == 51
    run(tmp_path / "raw", tmp_path / "undisturbed")
    assert [tuple(pair) for pair in found["content"]] == content(tmp_path / "undisturbed")


@pytest.mark.long
def test_a_read_only_file_system_can_be_read(tmp_path):
    """Even root cannot write there."""
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / "lake")
    raw_of(raw, 1, 1)
    lake = tmp_path / "lake"
    mounts = f"mount --bind '{lake}' '{lake}' && mount -o remount,bind,ro '{lake}'"
    found = in_own_mounts(mounts, READ_ONLY, lake, raw)
    for message in found["messages"]:
        assert message.startswith("cannot write ")
        assert "Read-only file system; choose a folder you may write to, or change its permissions" in message
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


def test_files_that_may_not_grow(tmp_path):
    """A quota on file size: what a full disk is where nothing can be mounted."""
    run(raw_of(tmp_path / "raw", 0, 1), tmp_path / "lake")
    before = everything(tmp_path / "lake")
    more = raw_of(tmp_path / "more", 1, 1, lines=9)
    command = [sys.executable, "-c", LIMITED_FILES, str(more), str(tmp_path / "lake")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.stdout.count("\n") == 1, done.stderr
    assert "File too large; free some space and run the same command again" in done.stdout
    assert done.stderr == ""
    assert everything(tmp_path / "lake") == before


# --- damaged ------------------------------------------------------------------------------------------


@pytest.fixture
def lake(tmp_path):
    return write_lake(tmp_path / "lake", [make_scenario(k, num_objects=2) for k in (1, 2)])


def one(lake, table):
    (path,) = (Path(path) for path in lake.paths(table))
    return path


@pytest.mark.parametrize("table", ["tracks", "lights", "maps"])
@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "garbage"])
def test_damaged_content_is_named_when_it_is_loaded(lake, table, damage):
    path = one(lake, table)
    data = path.read_bytes()
    path.unlink()
    if damage != "gone":
        path.write_bytes({"empty": b"", "cut": data[:-9], "garbage": bytes(range(256)) * 40}[damage])
    with pytest.raises(LakeError, match=rf"cannot read {path}: .*`scenarionet check` names every scenario"):
        ScenarioLoader(lake)[0]


def test_damaged_pages_are_named_when_they_are_loaded(lake):
    path = one(lake, "tracks")
    data = bytearray(path.read_bytes())
    data[4:2000] = bytes(1996)
    path.write_bytes(data)
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        ScenarioLoader(lake)[0]


@pytest.mark.parametrize("table", ["tracks", "lights", "maps"])
def test_a_file_of_another_contract_is_refused(lake, table):
    path = one(lake, table)
    rows = pq.read_table(path, partitioning=None)
    tag = {**rows.schema.metadata, b"scenarionet.schema": f"{table}/99".encode()}
    pq.write_table(rows.replace_schema_metadata(tag), path)
    with pytest.raises(
        SchemaMismatch, match=rf"{path.name}: written under schema {table}/99, this version reads {table}/1"
    ):
        ScenarioLoader(lake)[0]


def test_lost_metadata_is_named(lake):
    one(lake, "metadata").unlink()
    with pytest.raises(LakeError, match="metadata"):
        ScenarioLoader(lake.root)


@pytest.mark.parametrize("data", [None, b"", b"PAR1" * 9])
def test_a_damaged_manifest_is_named(lake, data):
    path = next(lake.root.glob("snapshots/manifest-*.parquet"))
    path.unlink()
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        len(Lake(lake.root))
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        run(raw_of(lake.root.parent / "raw", 5, 1), lake.root)


def test_recordings_that_vanish_fail_alone(tmp_path, monkeypatch):
    raw = raw_of(tmp_path / "raw", 0, 2)

    def vanish(done, *_):
        if done:
            (raw / "s000.made").unlink(missing_ok=True)  # the larger one comes first

    report = run(raw, tmp_path / "lake", on_progress=vanish)
    assert report.converted == 2
    ((name, reason),) = report.failed
    assert name == "s000"
    assert "No such file or directory" in reason


def test_links_in_the_path_of_a_lake(tmp_path):
    """A lake reached through a link is the same lake."""
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / "link" / "lake")
    assert run(raw, tmp_path / "real" / "lake").skipped == 1
    assert len(Lake(tmp_path / "link" / "lake")) == 2
    assert LakeFiles(tmp_path / "link" / "lake").root == (tmp_path / "real" / "lake").resolve()


@pytest.mark.parametrize("name", ['it\'s a "lake"', "ü 100% a=b", "[x]*?"])
def test_odd_names_of_folders(tmp_path, name):
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / name)
    lake = Lake(tmp_path / name)
    assert len(lake) == 2
    assert lake.sql("SELECT count(*) AS n FROM tracks JOIN metadata USING (scenario_id)")["n"][0] == 4
    assert len(ScenarioLoader(lake)[1].tracks) == 2
